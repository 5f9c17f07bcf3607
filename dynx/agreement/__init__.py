"""Agreement of backends: pairwise, with a 50-digit referee, and with identities of mechanics."""

from __future__ import annotations

from dynx.agreement.agreement import agree
from dynx.agreement.comparison import Comparison, WorstSample
from dynx.agreement.identities import IdentityCheck
from dynx.agreement.referee import Referee
from dynx.agreement.report import AgreementReport, Failure, Suspect, refused_report, results_document

__all__ = [
    "AgreementReport",
    "Comparison",
    "Failure",
    "IdentityCheck",
    "Referee",
    "Suspect",
    "WorstSample",
    "agree",
    "refused_report",
    "results_document",
]
