//! A piston position that the load pressure shows, too.
//!
//! On stiff oil a piston that moves by 0.01 mm, by which a good encoder scatters, changes its load pressure by 0.1 bar, which two sensors show as well.
//! So does, more slowly, what the pump delivers and what leaks: what no travel accounts for is followed beside. Both together scatter less than
//! either. Oil that is softer than thought shows less than the piston moves by, so that no more than some of an encoder's scatter is made good for.

use hydroboom_math::Real;

/// How a position is read from the load pressure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeByPressure<T> {
    /// A position that is measured scatters by so much \[m\].
    pub stroke_scatter: T,
    /// The load pressure by so much, oil that is not quite as stiff as thought reckoned in \[Pa\].
    pub pressure_scatter: T,
    /// What of a load pressure that no travel accounts for is remembered in a period.
    pub keeps: T,
}

/// By how much the load pressure corrects a measured position at most, over what that scatters by.
const CORRECTS: f64 = 4.0;

impl<T: Real> StrokeByPressure<T> {
    /// What of a position is read from the load pressure, 0 to 1, where a travel makes for so much of it \[Pa/m\].
    #[inline(always)]
    pub(crate) fn share(&self, pressure_by_stroke: T) -> T {
        let stroke = (pressure_by_stroke * self.stroke_scatter).square();
        stroke / (stroke + self.pressure_scatter.square())
    }

    /// Mean square \[m²\] by which a position scatters of which such a share is read from the load pressure.
    #[inline(always)]
    pub(crate) fn scatter(&self, share: T) -> T {
        (T::one() - share) * self.stroke_scatter.square()
    }

    /// The position \[m\] of a piston whose stroke \[m\] and load pressure \[Pa\] are measured, such a share being read from the load pressure,
    /// which a travel makes for so much of \[Pa/m\]; and what of that no travel accounts for \[Pa\], as it was thought to be before.
    #[inline(always)]
    pub(crate) fn read(
        &self,
        [stroke, load_pressure]: [T; 2],
        pumped: T,
        share: T,
        pressure_by_stroke: T,
    ) -> [T; 2] {
        let beyond = load_pressure - pressure_by_stroke * stroke - pumped;
        let travel = self.keeps * beyond;
        let most = T::lit(CORRECTS) * self.stroke_scatter;
        let correction = (travel / pressure_by_stroke).clamp(-most, most);
        [stroke + share * correction, pumped + beyond - travel]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READS: StrokeByPressure<f64> =
        StrokeByPressure { stroke_scatter: 1e-5, pressure_scatter: 1e4, keeps: 0.99 };
    const STIFF: f64 = -1e9;

    /// Numbers that scatter evenly, with a root mean square of 1, and never the same twice.
    fn scattered(k: u32, seed: u32) -> f64 {
        let turned = f64::from(k * 7919 + seed) * 0.618_033_988_75;
        (turned - turned.floor() - 0.5) * 12.0_f64.sqrt()
    }

    #[test]
    fn both_together_scatter_less_than_either() {
        let share = READS.share(STIFF);
        assert!((share - 0.5).abs() < 1e-12, "{share}");
        let (mut pumped, mut square) = (0.0, 0.0);
        let count = 20_000;
        for k in 0..count {
            let read = [1e-5 * scattered(k, 3), 1e4 * scattered(k * 3 + 1, 1_000)];
            let [stroke, left] = READS.read(read, pumped, share, STIFF);
            (pumped, square) = (left, square + stroke * stroke);
        }
        let found = square / f64::from(count);
        assert!((found / READS.scatter(share) - 1.0).abs() < 0.15, "{found:e}");
        assert!((READS.scatter(share) / 0.5e-10 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_piston_that_moves_is_where_it_is_measured_to_be() {
        let share = READS.share(STIFF);
        let mut pumped = 3e5;
        for k in 0..1000 {
            let stroke = 1e-4 * f64::from(k);
            let [read, left] = READS.read([stroke, 3e5 + STIFF * stroke], pumped, share, STIFF);
            assert!((read - stroke).abs() < 1e-12 && (left - 3e5).abs() < 1e-3);
            pumped = left;
        }
    }

    #[test]
    fn what_is_pumped_or_leaks_or_softer_oil_misleads_by_no_more_than_some_scatter() {
        let share = READS.share(STIFF);
        let mut pumped = 0.0;
        for k in 0..5000 {
            // 10 bar/s that nobody knows of, and oil of half the stiffness in a swing of 5 mm
            let stroke = 5e-3 * (1e-2 * f64::from(k)).sin();
            let pressure = 1e3 * f64::from(k) + 0.5 * STIFF * stroke;
            let [read, left] = READS.read([stroke, pressure], pumped, share, STIFF);
            assert!((read - stroke).abs() < 2.1e-5, "{read} for {stroke}");
            pumped = left;
        }
        // at rest it is forgotten
        for _ in 0..1000 {
            let [_, left] = READS.read([0.0, 5e6], pumped, share, STIFF);
            pumped = left;
        }
        assert!((pumped / 5e6 - 1.0).abs() < 1e-3, "{pumped}");
    }

    #[test]
    fn soft_oil_shows_nothing() {
        assert!(READS.share(STIFF / 80.0) < 2e-4);
    }
}
