"""The machine that kernels are compiled for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import llvmlite
from llvmlite import binding


@dataclass(frozen=True)
class Target:
    """A processor as LLVM knows it: triple, name, features."""

    triple: str
    cpu: str
    features: str

    @property
    def fma(self) -> bool:
        """Whether it multiplies and adds in one operation with one rounding."""
        return "+fma" in self.features.split(",") or self.triple.startswith(("aarch64", "arm64"))

    @property
    def lanes(self) -> int:
        """Doubles in its widest vector register."""
        features = set(self.features.split(","))
        if "+avx512f" in features:
            return 8
        return 4 if "+avx" in features else 2

    @property
    def near(self) -> bool:
        """Whether code may reach its constants by short addresses, which takes a tenth of its bytes off.

        LLVM's newer linker puts all of an object into one piece of memory; the older one, which may put
        constants gigabytes away, is left where the newer one is not known to work.
        """
        return self.triple.startswith("x86_64") and "windows" not in self.triple

    def machine(self) -> binding.TargetMachine:
        """LLVM's code generator for it."""
        _initialise()
        target = binding.Target.from_triple(self.triple)
        model = "small" if self.near else "jitdefault"
        return target.create_target_machine(
            cpu=self.cpu, features=self.features, opt=2, reloc="pic", codemodel=model, jit=True
        )


def sse2() -> Target:
    """What every x86-64 processor can do: vectors of two doubles, no fused multiply-add."""
    return Target(binding.get_process_triple(), "x86-64", "")


@cache
def host() -> Target:
    """The processor this runs on."""
    _initialise()
    return Target(
        binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    )


def compiler_version() -> str:
    """Of everything that decides what machine code a module becomes."""
    return f"llvmlite {llvmlite.__version__}, LLVM {'.'.join(map(str, binding.llvm_version_info))}"


@cache
def _initialise() -> None:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
