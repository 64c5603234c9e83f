//! Lengths in millimetres for messages and results.

/// Length \[mm\] of one in \[m\], with 13 significant digits: without the rounding noise of unit and shares, 105 mm and
/// not 105.00000000000001 mm.
pub fn millimetres(metres: f64) -> f64 {
    let exact = metres * 1e3;
    format!("{exact:.12e}").parse().unwrap_or(exact)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_a_stroke_has_no_rounding_noise() {
        for (metres, wanted) in [(0.15 * 0.7, 105.0), (0.7, 700.0), (0.9 * 0.7, 630.0)] {
            assert_eq!(millimetres(metres), wanted);
        }
        assert_eq!(millimetres(0.123_456_789), 123.456_789);
        assert!(millimetres(f64::NAN).is_nan() && millimetres(f64::INFINITY).is_infinite());
    }
}
