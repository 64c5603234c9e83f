//! Check that the processor has the instructions the program was compiled for.

/// Ends the program with a message, instead of by an illegal instruction, on a processor without AVX2 and FMA for which
/// it was compiled.
#[cfg(target_arch = "x86_64")]
pub fn check() {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    // the processor itself is queried, because the standard library's detection trusts the build's target
    // features
    const FMA: u32 = 1 << 12;
    const AVX2: u32 = 1 << 5;
    let fused = !cfg!(target_feature = "fma") || __cpuid(1).ecx & FMA != 0;
    let wide = !cfg!(target_feature = "avx2")
        || (__cpuid(0).eax >= 7 && __cpuid_count(7, 0).ebx & AVX2 != 0);
    if !(fused && wide) {
        crate::output::note(
            "This program was compiled for processors with AVX2 and FMA, and this one has not both.\n\
             Compile it with RUSTFLAGS=\"-C target-cpu=x86-64-v2\": same results, slower.",
        );
        std::process::exit(1);
    }
}

/// No check on other architectures: only x86-64 is compiled for more than its baseline.
#[cfg(not(target_arch = "x86_64"))]
pub fn check() {}
