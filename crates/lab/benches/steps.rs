//! Execution time of an integration step: `cargo bench -p hydroboom-lab --bench steps`.

use divan::{Bencher, black_box};
use hydroboom_description::Description;
use hydroboom_math::{Lanes, simd};
use hydroboom_model::stepping::{Implicit, published, runge_kutta_4};
use hydroboom_model::{Crane, CraneState, Input};

const STEP: f64 = 50e-6;
const INPUT: Input<f64> = Input { pump_speed: 10.0, holding_valve: 1.0 };

fn main() {
    divan::main();
}

#[expect(clippy::unwrap_used, reason = "the embedded crane is tested")]
fn crane<const N: usize>() -> (Crane<f64, N>, CraneState<f64, N>) {
    let mut description = Description::uia_single_boom().unwrap();
    description.set(&format!("boom.segments={N}")).unwrap();
    let crane = description.crane::<N>().unwrap();
    let state = crane.at_rest(&description.start(0.25)).unwrap();
    (crane, state)
}

#[divan::bench(sample_size = 1000)]
fn published_three_segments(bencher: Bencher<'_, '_>) {
    let (crane, mut state) = crane::<3>();
    bencher.bench_local(|| published(&crane, &mut state, black_box(&INPUT), STEP));
}

/// Eight simulations per call; divide the time by eight.
#[divan::bench(sample_size = 1000)]
fn published_three_segments_eight_lanes(bencher: Bencher<'_, '_>) {
    struct OneStep<'a> {
        crane: &'a Crane<Lanes<8>, 3>,
        state: &'a mut CraneState<Lanes<8>, 3>,
        input: &'a Input<Lanes<8>>,
    }
    impl simd::Kernel for OneStep<'_> {
        type Output = ();
        #[inline(always)]
        fn run(self) {
            published(self.crane, self.state, black_box(self.input), Lanes([STEP; 8]));
        }
    }
    let (crane, state) = crane::<3>();
    let wide = crane.map(&mut |v| Lanes([v; 8]));
    let mut state = state.map(|v| Lanes([v; 8]));
    let input = INPUT.map(|v| Lanes([v; 8]));
    bencher.bench_local(|| {
        simd::run(OneStep { crane: &wide, state: &mut state, input: &input });
    });
}

#[divan::bench(sample_size = 1000)]
fn runge_kutta_three_segments(bencher: Bencher<'_, '_>) {
    let (crane, mut state) = crane::<3>();
    bencher.bench_local(|| runge_kutta_4(&crane, &mut state, black_box(&INPUT), STEP));
}

#[divan::bench(consts = [3, 10, 50], sample_size = 100)]
fn implicit<const N: usize>(bencher: Bencher<'_, '_>) {
    let (crane, mut state) = crane::<N>();
    let scheme = Implicit::new(&crane);
    bencher.bench_local(|| scheme.step(&crane, &mut state, black_box(&INPUT), STEP));
}
