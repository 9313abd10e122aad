"""How probable it is that each effect acts: sets of effects compared by their evidence, beside a rest that nobody can name.

The order is that of the data: :mod:`hypotheses` lists what may act, :mod:`discrepancy` what may be left over, :mod:`matrix`
holds their columns beside those of the model, :mod:`states` the states of the noise, :mod:`weights` gives the evidence of one
set, :mod:`search` finds the sets that count, :mod:`checks` asks whether an effect that leads is the same in parts of the data,
and :mod:`answer` says it. The limits are in ``policy/evidence.py``. The folder imports ``inference``, ``variables`` and
``effects``.
"""
