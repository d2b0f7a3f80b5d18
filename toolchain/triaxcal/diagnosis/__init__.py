"""Which physical cause explains readings best: competing causes, ranked by their evidence."""

from triaxcal.diagnosis.answer import Diagnosis, Suspect, diagnose

__all__ = ["Diagnosis", "Suspect", "diagnose"]
