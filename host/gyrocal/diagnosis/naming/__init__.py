"""Which effect explains a misfit: the candidates, the evidence for each, and the decision."""
