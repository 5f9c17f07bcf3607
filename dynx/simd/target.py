"""Processor that kernels are compiled for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import llvmlite
from llvmlite import binding


@dataclass(frozen=True)
class Processor:
    """Processor description of LLVM: target triple, name, features."""

    triple: str
    cpu: str
    features: str

    @property
    def fma(self) -> bool:
        """True if the processor has fused multiply-add."""
        return "+fma" in self.features.split(",") or self.triple.startswith(("aarch64", "arm64"))

    @property
    def lanes(self) -> int:
        """Number of doubles in the widest vector register."""
        features = set(self.features.split(","))
        if "+avx512f" in features:
            return 8
        return 4 if "+avx" in features else 2

    @property
    def estimates_roots(self) -> bool:
        """True if an instruction estimates the reciprocal square roots of the widest vector of doubles."""
        return self.lanes == 8

    @property
    def short_addresses(self) -> bool:
        """True if code may address its constants by 32-bit offsets, which makes it a tenth smaller.

        That needs LLVM's JITLink, which allocates an object in one block of memory. The older linker, which
        may place constants gigabytes away, is used where JITLink is not known to work.
        """
        return self.triple.startswith("x86_64") and "windows" not in self.triple

    def machine(self, *, quick: bool = False) -> binding.TargetMachine:
        """Return LLVM's code generator for the processor; a `quick` one optimises nothing."""
        _initialise()
        target = binding.Target.from_triple(self.triple)
        model = "small" if self.short_addresses else "jitdefault"
        return target.create_target_machine(
            cpu=self.cpu,
            features=self.features,
            opt=0 if quick else 2,
            reloc="pic",
            codemodel=model,
            jit=True,
        )


@cache
def host() -> Processor:
    """Return the processor of this machine."""
    _initialise()
    return Processor(
        binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
    )


def compiler_version() -> str:
    """Return the versions of llvmlite and LLVM, which determine the machine code of a module."""
    return f"llvmlite {llvmlite.__version__}, LLVM {'.'.join(map(str, binding.llvm_version_info))}"


def set_llvm_option(option: str) -> None:
    """Set an option of LLVM's command line for the whole process."""
    binding.set_option("dynx", option)


@cache
def _initialise() -> None:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
