//! Run-time selection of the machine's widest vector instructions.
//!
//! A [`Kernel`] is compiled once for each instruction set and run with the best one present. Its result does not
//! depend on the instruction set: all round additions, multiplications, divisions and roots alike, and two operations
//! are fused only where the source says `mul_add`.

/// Code to be compiled for several instruction sets. `run` and all functions that it calls must be
/// `#[inline(always)]`; other functions keep the instructions of the default build.
pub trait Kernel {
    /// Result of the kernel.
    type Output;
    /// Executes the kernel.
    fn run(self) -> Self::Output;
}

/// Name of the instruction set that [`run`] uses on this machine: `AVX-512`, `AVX2` or `default build`.
pub fn chosen() -> &'static str {
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    {
        if has_avx512() {
            return "AVX-512";
        }
        if has_avx2() {
            return "AVX2";
        }
    }
    "default build"
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
fn has_avx512() -> bool {
    std::arch::is_x86_feature_detected!("fma")
        && std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
        && std::arch::is_x86_feature_detected!("avx512bw")
}

#[cfg(all(target_arch = "x86_64", feature = "std"))]
fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

/// Runs a kernel with the widest instruction set of this machine, and returns its output.
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(all(target_arch = "x86_64", feature = "std"))]
    {
        #[target_feature(enable = "fma,avx512f,avx512dq,avx512vl,avx512bw")]
        fn avx512<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        #[target_feature(enable = "avx2,fma")]
        fn avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        if has_avx512() {
            // SAFETY: the features were detected on this machine just above
            #[expect(unsafe_code, reason = "the features are detected first")]
            return unsafe { avx512(kernel) };
        }
        if has_avx2() {
            // SAFETY: the features were detected on this machine just above
            #[expect(unsafe_code, reason = "the features are detected first")]
            return unsafe { avx2(kernel) };
        }
    }
    kernel.run()
}
