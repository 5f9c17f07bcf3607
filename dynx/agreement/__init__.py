"""Agreement of backends: pairwise, with a 50-digit referee, and with identities of mechanics."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.agreement.agreement import agree
from dynx.agreement.comparison import Comparison, WorstSample
from dynx.agreement.identities import IdentityCheck
from dynx.agreement.referee import Referee
from dynx.agreement.report import AgreementReport, LoadFailure, Suspect, refused_report, results_document
from dynx.registry import moved_names

__all__ = [
    "AgreementReport",
    "Comparison",
    "IdentityCheck",
    "LoadFailure",
    "Referee",
    "Suspect",
    "WorstSample",
    "agree",
    "refused_report",
    "results_document",
]

if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {"Failure": "dynx.agreement.LoadFailure"})
