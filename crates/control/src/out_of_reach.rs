//! A reference that is out of the motor's reach.
//!
//! A simulated crane whose motor is at its limit swings as soft oil lets it, and the machine swings otherwise. Feedback would brake a machine that is
//! ahead of the simulated crane, though both are behind the reference: what it loses by that, nobody makes good for.

/// The motor counts as at its limit from this share of its speed on, all the more the nearer.
const NEAR: f64 = 0.8;
/// A reference is out of reach once it is this far away \[m\], all the more the nearer to that.
const FAR: f64 = 2e-3;
/// It is within reach for a machine that will have come up with it in that time \[s\]: that has to be braked.
const COMES_UP: f64 = 0.15;

/// From 0 to 1, by how far a reference runs ahead of what any crane can follow \[m\].
pub(crate) fn out_of_reach(ahead: f64) -> f64 {
    (ahead.abs() / FAR).min(1.0)
}

/// Speed \[rev/s\] for a machine of which feedback wants a `speed` \[rev/s\]. It is behind the reference by `behind` \[m\], and that
/// runs ahead of what any crane can follow by `ahead` \[m\]; it comes up with it by `closing` \[m/s\]. What leads it takes `leading` \[rev/s\], whichever is farther that way, of a motor
/// that has `limit` \[rev/s\].
pub(crate) fn not_braked(
    speed: f64,
    leading: [f64; 2],
    limit: f64,
    behind: f64,
    closing: f64,
    ahead: f64,
) -> f64 {
    let direction = behind.signum();
    let still_behind = behind.abs() - COMES_UP * (direction * closing).max(0.0);
    let leading = leading.map(|speed| direction * speed).into_iter().fold(f64::MIN, f64::max);
    let far = still_behind.min(direction * ahead).max(0.0) / FAR;
    let near = (leading / limit - NEAR) / (1.0 - NEAR);
    let braked = leading.clamp(-limit, limit) - direction * speed;
    speed + direction * near.clamp(0.0, 1.0) * far.min(1.0) * braked.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: f64 = 50.0;

    #[test]
    fn at_the_limit_a_machine_that_is_behind_the_reference_is_not_braked() {
        for side in [1.0, -1.0] {
            let told = |speed: f64, leading: f64, behind: f64, ahead: f64| {
                let [speed, leading, behind, ahead] =
                    [speed, leading, behind, ahead].map(|value| side * value);
                side * not_braked(speed, [0.0, leading], LIMIT, behind, -side * 0.1, ahead)
            };
            assert_eq!(told(30.0, 51.0, 5e-3, 8e-3), LIMIT);
            // what drives it on is feedback's
            assert_eq!(told(49.0, 45.0, 5e-3, 8e-3), 49.0);
            // a motor that has speed left brings it back in time
            assert_eq!(told(20.0, 39.0, 5e-3, 8e-3), 20.0);
            // it is past the reference, or the reference within reach
            for (behind, ahead) in [(-5e-3, 8e-3), (5e-3, 0.0), (5e-3, -8e-3), (0.0, 8e-3)] {
                assert_eq!(told(30.0, 51.0, behind, ahead), 30.0);
            }
        }
    }

    #[test]
    fn a_machine_that_comes_up_with_the_reference_is_braked_in_time() {
        let (behind, fast) = (20e-3, 20e-3 / COMES_UP);
        let told = |closing| not_braked(30.0, [LIMIT, LIMIT], LIMIT, behind, closing, 1.0);
        assert_eq!((told(fast), told(0.5 * fast), told(-fast)), (30.0, LIMIT, LIMIT));
    }

    #[test]
    fn it_is_let_go_of_without_a_jump() {
        let told = |leading, behind| not_braked(30.0, [leading, 0.0], LIMIT, behind, 0.0, 1.0);
        for k in 0..1000 {
            let share = f64::from(k) * 1e-3;
            let (leading, behind) = (LIMIT * share, FAR * share);
            assert!((told(leading + 0.05, FAR) - told(leading, FAR)).abs() < 0.2);
            assert!((told(LIMIT, behind + 1e-3 * FAR) - told(LIMIT, behind)).abs() < 0.03);
        }
    }
}
