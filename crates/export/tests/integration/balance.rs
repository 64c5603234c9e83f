//! Newton's step with a fixed order of elimination compared with row exchanges, for different booms.

use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_model::Crane;

/// Steps after which nothing changes but last digits.
const ROUNDS: usize = 12;

/// The largest difference between the two in angles \[rad\], and in pressures as a share.
fn apart<const N: usize>(description: &Description, change: impl Fn(&mut Numbers<f64>)) -> f64 {
    let n = &description.numbers;
    let rest = description.crane::<N>().unwrap();
    let mut state = rest.at_rest(&description.start_over(n, n.motion_start)).unwrap();
    let mut n = *n;
    change(&mut n);
    let crane: Crane<f64, N> = description.crane_over(&n).unwrap();
    let start = description.start_over(&n, n.motion_start);
    for _ in 0..ROUNDS {
        state = crane.balanced(&start, &state);
    }
    let wanted = crane.at_rest(&start).unwrap();
    let angles = state.boom.angle.into_iter().zip(wanted.boom.angle);
    let (found, pressure) = (state.circuit.nodes.a, wanted.circuit.nodes.a);
    angles.map(|(a, b)| (a - b).abs()).fold((found / pressure - 1.0).abs(), f64::max)
}

#[test]
fn both_solvers_find_the_same_equilibrium_for_every_boom() {
    let three = Description::uia_single_boom().unwrap();
    let text = include_str!("../../../../cranes/uia-virtual.toml");
    let many = Description::parse("uia-virtual", text).unwrap();
    assert_eq!((three.coordinates(), many.coordinates()), (3, 11));
    for payload in [0.0, 50.0, 307.0, 500.0, 900.0] {
        for share in [0.0, 0.5, 1.0] {
            let change = |n: &mut Numbers<f64>| {
                n.payload = payload;
                n.motion_start = share * n.stroke;
            };
            let off = [apart::<3>(&three, change), apart::<11>(&many, change)];
            // more segments round more: their joints are stiffer
            assert!(off[0] < 1e-11 && off[1] < 1e-9, "{payload} kg at {share}: {off:?}");
        }
    }
}
