"""Inverse Cholesky factors of small symmetric matrices, many at once: with them, solutions and determinants are sums."""

from __future__ import annotations

import numpy as np

from gyrocal.recording.session import Array


def inverse_factor(matrices: Array) -> tuple[Array, Array]:
    """The inverses R [..., k, k] of the Cholesky factors of matrices, ``matrix^-1 = R' R``, and the log-determinants [...].

    Numbers, and a single matrix, take less time without NumPy's loop over many matrices. Raises LinAlgError if one of them is
    not positive definite.
    """
    if matrices.shape[-1] == 1:
        if not (matrices > 0).all():
            raise np.linalg.LinAlgError
        return 1 / np.sqrt(matrices), np.log(matrices[..., 0, 0])
    if matrices.ndim == 2 and matrices.size:
        from scipy.linalg.lapack import dpotrf, dtrtri

        factor, failed = dpotrf(matrices, lower=True)
        if failed:
            raise np.linalg.LinAlgError
        return dtrtri(factor, lower=True)[0], np.asarray(2 * np.log(factor.diagonal()).sum())
    factors = np.linalg.cholesky(matrices)
    return np.linalg.inv(factors), 2 * np.log(np.diagonal(factors, axis1=-2, axis2=-1)).sum(axis=-1)


def with_prior(information: Array) -> tuple[Array, Array]:
    """The same of standardised coefficients' information [..., k, k], which their prior alone makes the identity.

    Where more of the noise of measured columns was taken out than is there, the data say nothing.
    """
    try:
        return inverse_factor(information)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(information)
        return inverse_factor((vectors * np.maximum(values, 1.0)[..., None, :]) @ vectors.swapaxes(-1, -2))
