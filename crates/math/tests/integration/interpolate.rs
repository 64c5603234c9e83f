//! Interpolation in a table.

use hydroboom_math::{Dual, Lanes, Real};

const TABLE: [f64; 5] = [3.0, -1.0, 4.5, 4.5, 1e3];

/// Types that read two entries and types that weight all entries agree to the last bit.
#[test]
fn every_number_interpolates_alike() {
    let table = TABLE.map(Dual::<f64, 1>::constant);
    let lanes = TABLE.map(|entry| Lanes([entry; 4]));
    for k in -8..40 {
        let place = 0.13 * f64::from(k);
        let plain = f64::interpolate(&TABLE, place);
        assert_eq!(plain, Dual::interpolate(&table, Dual::constant(place)).value, "{place}");
        assert_eq!([plain; 4], Lanes::interpolate(&lanes, Lanes([place; 4])).0, "{place}");
    }
}

#[test]
fn a_table_is_linear_between_its_entries_and_constant_beyond_its_ends() {
    for (place, wanted) in
        [(0.0, 3.0), (0.25, 2.0), (1.0, -1.0), (1.5, 1.75), (-7.0, 3.0), (9.0, 1e3)]
    {
        assert!((f64::interpolate(&TABLE, place) - wanted).abs() < 1e-12, "{place}");
    }
    assert!(f64::interpolate(&TABLE, f64::NAN).is_nan());
    assert_eq!(f64::interpolate(&[], 1.0), 0.0);
    assert_eq!(f64::interpolate(&[2.0], 5.0), 2.0);
}

/// Derivatives with respect to an entry and to the index.
#[test]
fn the_slope_is_that_of_the_line_between_two_entries() {
    let table = TABLE.map(Dual::<f64, 1>::constant);
    let slope = Dual::interpolate(&table, Dual::variable(1.25, 0)).slope[0];
    assert!((slope - 5.5).abs() < 1e-12, "{slope}");
}
