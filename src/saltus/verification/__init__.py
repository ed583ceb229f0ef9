"""Checks of results by means that share no code with how they were made."""

from saltus.verification.table import Row, Verification
from saltus.verification.verify import verify

__all__ = ["Row", "Verification", "verify"]
