"""The recipe for a rule: one class and one trap, in dynx's catalogue or in a package of somebody else."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

import dynx
from dynx.doctor import diagnose
from dynx.errors import DynxError
from dynx.rules import Rule, all_rules, find_rule, registry
from dynx.rules.registry import find_trap

MODULE = '''from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on

ZERO = """<inertial>
  <mass value="0"/>
  <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
</inertial>"""


class UnweighedLink(EditingRule):
    """ACME101 unweighed-link: A link has no <inertial>, which PyBullet reads as 1 kg.

    Our exporter leaves the ``<inertial>`` of camera frames out.

    What to do: write an inertial of zero.
    """

    advice = "Write an inertial of zero."
    engines = measured_on("pybullet")
    changed = "wrote inertials of zero"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Links below the root without one."""
        for name, link in case.links.items():
            if name != case.model.root and link.first("inertial") is None:
                yield correction(link, "no <inertial>", case.source.insertion(link, ZERO, first=True))
'''

Install = Callable[..., None]


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield the folder of a package that follows the recipe; its trap is the one of DX101."""
    (tmp_path / "acme101_unweighed_link.py").write_text(MODULE)
    (tmp_path / "acme101_unweighed_link.urdf").write_bytes(find_trap("DX101").read_bytes())
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    sys.modules.pop("acme101_unweighed_link", None)


@pytest.fixture
def install(monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Yield a function that installs entry points in a dynx without DX101, for the time of a test."""
    own = tuple(rule for rule in all_rules() if rule.id != "DX101")
    monkeypatch.setattr(registry, "_own_rules", lambda: own)

    def install(*values: str) -> None:
        points = EntryPoints(EntryPoint(f"rule{k}", value, "dynx.rules") for k, value in enumerate(values))
        monkeypatch.setattr("dynx.registry.installed_entry_points", lambda group: points.select(group=group))
        all_rules.cache_clear()

    install()
    yield install
    monkeypatch.undo()
    all_rules.cache_clear()


def test_a_module_and_a_trap_of_another_package_are_a_rule(package: Path, install: Install) -> None:
    trap = package / "acme101_unweighed_link.urdf"
    engines = ["pinocchio", "pybullet"]
    assert not diagnose(trap, engines=engines, counterexamples=False).explained

    install("acme101_unweighed_link:UnweighedLink")
    rule = find_rule("unweighed-link")
    assert all_rules()[-1] is rule
    assert (rule.id, rule.name) == ("ACME101", "unweighed-link")
    assert rule.title == "A link has no <inertial>, which PyBullet reads as 1 kg."
    assert find_trap(rule) == trap

    report = diagnose(trap, engines=engines, counterexamples=False)
    assert report.explained
    assert {(each.rule, each.proved) for each in report.differences} == {("ACME101", True)}
    assert len(list(package.glob("acme101*.*"))) == 2


def test_a_rule_of_dynx_is_a_class_that_no_module_names_and_a_trap() -> None:
    classes = {type(rule).__name__: type(rule) for rule in all_rules()}
    for path in Path(dynx.__file__).parent.rglob("*.py"):
        named = classes.keys() & set(re.findall(r"\w+", path.read_text(encoding="utf-8")))
        module = path.stem
        assert all(classes[name].__module__ == f"dynx.rules.catalogue.{module}" for name in named), path
    for rule in all_rules():
        assert find_trap(rule).is_file()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("acme101_unweighed_link:Missing", "cannot be loaded: AttributeError"),
        ("acme101_unweighed_link:ZERO", "is no subclass"),
        ("pathlib:Path", "is no subclass"),
        ("tests.architecture.test_recipe_rule:Headless", "does not begin with"),
        (
            "dynx.rules.catalogue.inertia_tensors:InertiaBrokenByRounding",
            "two rules are called dx102",
        ),
    ],
)
def test_an_entry_point_that_is_no_rule_is_refused_by_name(
    package: Path, install: Install, value: str, message: str
) -> None:
    install(value)
    with pytest.raises(DynxError, match=message):
        all_rules()


class Headless(Rule):
    """A rule whose docstring has no heading."""

    def occurrences(self, case: object) -> tuple[()]:
        """Nothing."""
        return ()
