//! Plain floating point: the number type of the real-time path.

use crate::{
    Real,
    elementary::{self, Binary},
};

macro_rules! real {
    ($Float:ident, $sqrt:path, $mul_add:path) => {
        impl Real for $Float {
            type Mask = bool;

            #[inline(always)]
            fn lit(value: f64) -> Self {
                value as $Float
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn any(mask: bool) -> bool {
                mask
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                $mul_add(self, factor, term)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                elementary::exp(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                elementary::ln(self)
            }
            #[inline(always)]
            fn tanh(self) -> Self {
                elementary::tanh(self)
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                elementary::sin_cos(self)
            }
            #[inline(always)]
            fn interpolate(table: &[Self], place: Self) -> Self {
                let last = table.len().saturating_sub(1);
                let place = Real::clamp(place, 0.0, last as $Float);
                // the cast maps NaN to the first entry; its weight is NaN then, and so is the result
                let first = (place as usize).min(last.saturating_sub(1));
                let entry = |k: usize| table.get(k).copied().unwrap_or(0.0);
                let weight = |k: usize| Real::max(1.0 - (place - k as $Float).abs(), 0.0);
                let sum = Real::mul_add(entry(first), weight(first), 0.0);
                match last {
                    0 => sum,
                    _ => Real::mul_add(entry(first + 1), weight(first + 1), sum),
                }
            }
        }
    };
}
// roots and fused products are correctly rounded everywhere, so they agree to the last bit
#[cfg(feature = "std")]
real!(f64, f64::sqrt, f64::mul_add);
#[cfg(feature = "std")]
real!(f32, f32::sqrt, f32::mul_add);
#[cfg(not(feature = "std"))]
real!(f64, libm::sqrt, libm::fma);
#[cfg(not(feature = "std"))]
real!(f32, libm::sqrtf, libm::fmaf);

impl Binary for f64 {
    const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
    const FRAC_PI_2: [f64; 2] = [1.570_796_251_296_997, 7.549_789_954_891_882e-8];
    // 1.5 * 2^52
    const ROUNDER: f64 = 6_755_399_441_055_744.0;
    const LARGEST_EXPONENT: f64 = 1022.0;

    #[inline(always)]
    fn power_of_two(held: Self) -> Self {
        // moved to the exponent's field, biased
        Self::from_bits(held.to_bits().wrapping_add(1023) << 52)
    }
    #[inline(always)]
    fn turn(held: Self, sin: Self, cos: Self) -> (Self, Self) {
        let (quarters, s, c) = (held.to_bits(), sin.to_bits(), cos.to_bits());
        // swapped after an odd number of quarters; signs change in the second half of a turn, and
        // for the cosine a quarter earlier
        let swapped = (s ^ c) & 0_u64.wrapping_sub(quarters & 1);
        let sine = s ^ swapped ^ ((quarters & 2) << 62);
        let cosine = c ^ swapped ^ ((quarters.wrapping_add(1) & 2) << 62);
        (Self::from_bits(sine), Self::from_bits(cosine))
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let bits = self.to_bits() as i64;
        // wrapping: numbers that are not positive are replaced by NaN below
        let e = bits.wrapping_sub(core::f64::consts::FRAC_1_SQRT_2.to_bits() as i64) >> 52;
        let m = f64::from_bits(bits.wrapping_sub(e << 52) as u64);
        // NaN, infinities and numbers that are not positive give NaN
        (if self > 0.0 && self < f64::INFINITY { m } else { f64::NAN }, e as f64)
    }
}

impl Binary for f32 {
    const LN_2: [f64; 2] = [0.693_359_375, -2.121_944_400_546_905_8e-4];
    const FRAC_PI_2: [f64; 2] = [1.570_312_5, 4.838_267_9e-4];
    // 1.5 * 2^23
    const ROUNDER: f64 = 12_582_912.0;
    const LARGEST_EXPONENT: f64 = 126.0;

    #[inline(always)]
    fn power_of_two(held: Self) -> Self {
        // moved to the exponent's field, biased
        Self::from_bits(held.to_bits().wrapping_add(127) << 23)
    }
    #[inline(always)]
    fn turn(held: Self, sin: Self, cos: Self) -> (Self, Self) {
        let (quarters, s, c) = (held.to_bits(), sin.to_bits(), cos.to_bits());
        // swapped after an odd number of quarters; signs change in the second half of a turn, and
        // for the cosine a quarter earlier
        let swapped = (s ^ c) & 0_u32.wrapping_sub(quarters & 1);
        let sine = s ^ swapped ^ ((quarters & 2) << 30);
        let cosine = c ^ swapped ^ ((quarters.wrapping_add(1) & 2) << 30);
        (Self::from_bits(sine), Self::from_bits(cosine))
    }
    #[inline(always)]
    fn split(self) -> (Self, Self) {
        let bits = self.to_bits() as i32;
        let e = bits.wrapping_sub(core::f32::consts::FRAC_1_SQRT_2.to_bits() as i32) >> 23;
        let m = f32::from_bits(bits.wrapping_sub(e << 23) as u32);
        (if self > 0.0 && self < f32::INFINITY { m } else { f32::NAN }, e as f32)
    }
}
