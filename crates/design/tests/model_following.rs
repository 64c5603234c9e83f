//! Designs against the crane that they were made for.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::controller::AxisState;
use hydroboom_control::deviation::Watched;
use hydroboom_control::feedback::benchmark::{Benchmark, BenchmarkInput};
use hydroboom_control::follower::Follower;
use hydroboom_control::learner::{Conditions, Learned, Learner};
use hydroboom_control::measurement::AxisSignals;
use hydroboom_control::reference::profile::SetPoint;
use hydroboom_description::Description;
use hydroboom_design::{
    Lifting, Loop, balances, informed, leakage, look, margins, model_following, oil_spring,
    overrides, schedule,
};
use hydroboom_model::Scheme;
use hydroboom_plant::plant;
use std::f64::consts::{PI, TAU};

/// The oil spring is three numbers of what the linearised crane has thirteen: poles of the whole crane are near those that were
/// placed, and what was not placed, bending, is left as damped as it was.
#[test]
fn poles_of_the_whole_crane_are_near_those_that_were_placed() {
    let crane = Description::uia_single_boom().unwrap();
    let law = model_following(&crane).unwrap();
    for stroke in [0.05, 0.25, 0.45] {
        let (spring, _) = oil_spring(&Lifting::new(&crane, stroke).unwrap()).unwrap();
        let look = look(&law, &crane, stroke).unwrap();
        assert!((spring.ring() / look.rings.imaginary - 1.0).abs() < 0.02, "{spring:?}");
        let ringing =
            look.poles.iter().find(|p| p.imaginary > 8.0).expect("a pair that was placed");
        assert!(ringing.damping_ratio > 0.25, "{stroke}: {ringing:?}");
        assert!(look.poles.iter().all(|p| p.real < 0.2), "{:?}", look.poles);
        let m = &look.state_feedback;
        assert!(m.distance > 0.5 && m.phase_deg > 40.0 && m.gain > 4.0, "{stroke}: {m:?}");
        let m = &look.machine;
        assert!(m.distance > 0.6 && m.phase_deg > 60.0 && m.gain > 3.0, "{stroke}: {m:?}");
    }
}

/// Where the boom rings with its piston held, the piston stands still whatever the pump does: what it answers passes zero there. Of that the least squares,
/// which look no farther than 1.3 times the ringing of both springs, know nothing.
#[test]
fn the_piston_stands_still_where_the_boom_alone_rings() {
    let mut crane = Description::uia_single_boom().unwrap();
    for payload in [150.0, 307.0] {
        crane.set(&format!("payload.mass_kg={payload}")).unwrap();
        for stroke in [0.1, 0.25, 0.4] {
            let lifting = Lifting::new(&crane, stroke).unwrap();
            let (_, boom) = oil_spring(&lifting).unwrap();
            let alone = (boom.acceleration_by_pressure / boom.give).sqrt() / TAU;
            let travels = |share: f64| {
                let seen = lifting.responses(share * alone).unwrap();
                (seen.position / seen.pressure).re
            };
            let (below, above) = (travels(0.97), travels(1.03));
            assert!(
                below < 0.0 && above > 0.0,
                "{payload} kg, {stroke} m: {alone} Hz, {below} {above}"
            );
        }
    }
}

/// Slowly enough, the pump's flow is the piston's area times its velocity, less the little that the seals leak: neither friction at
/// rest nor shut valves hold the piston.
#[test]
fn a_crane_that_lifts_goes_where_the_pumps_flow_sends_it() {
    for description in
        [Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap()]
    {
        let area = PI / 4.0 * description.numbers.piston.powi(2);
        for stroke in [0.05, 0.25, 0.45] {
            let lifting = Lifting::new(&description, stroke).unwrap();
            let velocity = lifting.responses(0.1).unwrap().velocity.norm();
            let share = velocity * area / description.numbers.displacement;
            assert!((0.85..1.0).contains(&share), "{stroke}: {share}");
        }
    }
}

/// Once they slide, bristles are neither a spring nor a damper: where friction holds at rest, the crane in motion is the same.
#[test]
fn bristles_that_slide_change_nothing_of_the_design() {
    let mut crane = Description::uia_single_boom().unwrap();
    let smooth = schedule(&crane).unwrap();
    crane.set("friction.law=lugre").unwrap();
    let bristles = schedule(&crane).unwrap();
    for (smooth, bristles) in smooth.laws.iter().zip(&bristles.laws) {
        assert_eq!(smooth, bristles);
    }
}

/// What is believed at once is believed with all the delay that it was read with.
#[test]
fn an_observer_that_believes_faster_leaves_less_margin() {
    let mut crane = Description::uia_single_boom().unwrap();
    let mut distance = |hz: f64| {
        crane.set(&format!("following.observer_hz={hz}")).unwrap();
        let law = model_following(&crane).unwrap();
        look(&law, &crane, 0.25).unwrap().machine.distance
    };
    let [slow, published, fast] = [8.0, 22.0, 120.0].map(&mut distance);
    assert!(slow > published + 0.05 && published > fast + 0.2, "{slow} {published} {fast}");
}

#[test]
fn a_crane_at_rest_is_weighed() {
    let crane = Description::uia_single_boom().unwrap();
    let schedule = schedule(&crane).unwrap();
    for payload in [0.0, 50.0, 180.0, 307.0] {
        let mut loaded = crane.clone();
        loaded.numbers.payload = payload;
        let plant = plant(&loaded, &loaded.start(0.2), Scheme::Implicit, 1e-3).unwrap();
        let found = schedule.payload(0.2, plant.load_pressure());
        // the load pressure at a position lies on a line over the payload but for the boom's bending
        assert!((found - payload).abs() < 2.0, "{found} kg for {payload} kg");
    }
}

#[test]
fn a_loop_whose_gain_rises_by_its_margin_rings_on() {
    let description = Description::uia_single_boom().unwrap();
    let crane = Lifting::new(&description, 0.25).unwrap();
    let benchmark = description.benchmark();
    let of = |factor: f64| {
        let controller = Benchmark {
            proportional: factor * benchmark.proportional,
            integral: factor * benchmark.integral,
            pressure_feedback: factor * benchmark.pressure_feedback,
            ..benchmark
        };
        let around = Loop::Benchmark { controller, high_pass: 1.04, delay: 5.5e-3 };
        margins(&crane, &around).unwrap()
    };
    let found = of(1.0);
    assert!(found.gain > 1.5 && found.distance > 0.3, "{found:?}");
    assert!(of(found.gain).distance < 0.02, "{:?}", of(found.gain));
    // a pair of modes, beyond it; with the wrong sign the piston runs off without ringing
    let growing = [0.9, 1.5, -1.0].map(|factor| of(factor * found.gain).growing);
    assert!(growing[..2] == [0, 2] && growing[2] % 2 == 1, "{growing:?}");
    // the distance from -1 bounds both other margins
    assert!(1.0 - 1.0 / found.gain >= found.distance - 1e-3);
    assert!(2.0 * (0.5 * found.phase_deg.to_radians()).sin() >= found.distance - 1e-3);
}

/// A law that is called less often answers later, and leaves as much less as that; what lies above half its rate it does not see.
#[test]
fn margins_end_at_half_the_rate_of_the_law() {
    let looked = |period_ms: f64| {
        let mut crane = Description::uia_single_boom().unwrap();
        crane.set(&format!("controller.control_period_ms={period_ms}")).unwrap();
        look(&model_following(&crane).unwrap(), &crane, 0.25).unwrap()
    };
    let [one, four] = [1.0, 4.0].map(looked);
    for (at_one, at_four) in
        [(one.machine, four.machine), (one.state_feedback, four.state_feedback)]
    {
        assert!(at_four.at_hz < 125.0 && at_four.crossover_hz < 125.0, "{at_four:?}");
        assert!(at_four.distance < at_one.distance && at_four.growing == 0, "{at_four:?}");
    }
}

/// A controller knows nothing of the model: its law of the oil's stiffness is held against the model's own.
#[test]
fn the_controllers_oil_is_the_models() {
    let description = Description::uia_single_boom().unwrap();
    let law = model_following(&description).unwrap();
    let oil = description.crane::<3>().unwrap().circuit.oil;
    for bar in [-0.5, 3.0, 20.0, 33.0, 35.0, 41.0, 70.0, 200.0] {
        let pressure = bar * 1e5;
        let (found, wanted) =
            (law.stiffness.share(pressure) * law.stiffness.highest, oil.bulk_modulus(pressure));
        assert!((found / wanted - 1.0).abs() < 1e-9, "{bar} bar: {found} for {wanted}");
        let between = |of: &dyn Fn(f64) -> f64| of(pressure + 5e5) - of(pressure);
        let (found, wanted) =
            (between(&|p| law.stiffness.compression(p)), between(&|p| oil.compression(p)));
        assert!((found / wanted - 1.0).abs() < 1e-6, "{bar} bar: {found} for {wanted}");
    }
}

/// A crane that goes where the simulated one goes, in the midst of a motion; and what is learned of it then.
fn in_motion() -> (Follower, Learned, SetPoint<f64>, AxisState<f64>, Watched<f64>) {
    let crane = Description::uia_single_boom().unwrap();
    let schedule = schedule(&crane).unwrap();
    let balances = balances(&crane, &schedule);
    let reference = SetPoint { position: 0.2, velocity: 0.1 };
    let seen = AxisState { stroke: 0.2, velocity: 0.1, load_pressure: 66e5 };
    let lead = crane.numbers.following_lead;
    let stroke = seen.stroke - lead * seen.velocity;
    let machine = Watched { stroke, load_pressure: seen.load_pressure, motor_speed: 0.0 };
    let learner =
        Learner::start(&schedule, &balances, crane.numbers.payload, &AxisSignals::default(), 66e5);
    let mut follower = Follower::new(learner);
    follower.begin(&machine, &seen);
    (follower, *learner.learned(), reference, seen, machine)
}

#[test]
fn a_pump_that_is_found_to_deliver_more_gives_no_bump() {
    let (mut follower, mut learned, _, seen, mut machine) = in_motion();
    let simulated = 36.0;
    machine.motor_speed = simulated;
    follower.begin(&machine, &seen);
    let before = follower.answer(&machine, &seen, simulated);
    learned.flow.balance.flow_gain *= 1.03;
    follower.set_learner(follower.learner().with(learned));
    let after = follower.answer(&machine, &seen, simulated);
    // three per cent would be a rev/s
    assert!((before - simulated).abs() < 0.05 && (after - before).abs() < 0.05, "{before} {after}");
    // what corrects is the gain then, and no longer the observer
    let corrected = (0..20_000).map(|_| {
        machine.motor_speed = simulated / 1.03;
        follower.answer(&machine, &seen, simulated)
    });
    let last = corrected.last().unwrap();
    assert!((last * 1.03 / simulated - 1.0).abs() < 1e-3, "{last}");
}

/// What a load that is lost asks of the motor hangs on the one that was there, whatever is believed of what is left; and the heavier that was, the more.
#[test]
fn what_waits_of_the_motor_goes_by_the_load_that_was_weighed() {
    let (follower, mut learned, ..) = in_motion();
    let learner = *follower.learner();
    let known = learner.known().conditions();
    let beyond = |payload: f64| learner.law_under(&Conditions { payload, ..known }).reserve.beyond;
    assert_eq!(beyond(0.3 * known.payload), beyond(known.payload));
    learned.weighed *= 0.5;
    assert!(learner.with(learned).law().reserve.beyond < 0.8 * beyond(known.payload));
}

/// A machine that is known to carry more than the simulated crane has taken on yet takes another motor speed for the same motion, but only while that
/// motion is state feedback's: what the benchmark asks of the simulated crane is told as it is.
#[test]
fn motion_is_translated_while_state_feedback_leads() {
    let (mut follower, mut learned, reference, seen, machine) = in_motion();
    learned.weighed *= 0.5;
    follower.set_learner(follower.learner().with(learned));
    let speed = follower.lead(&reference, &seen);
    let mut unlike = follower;
    let translated = unlike.answer(&machine, &seen, speed);
    let (reading, measured) = (AxisSignals::default(), BenchmarkInput::of_simulated(&seen));
    follower.learn(speed, &reference, &seen, &reading, &measured);
    let told = follower.answer(&machine, &seen, speed);
    assert!((told - speed).abs() < 0.5, "{told} for {speed}");
    assert!((translated - speed).abs() > 2.0, "{translated} for {speed}");
}

#[test]
fn feedback_is_as_careful_as_the_oil_is_in_doubt() {
    let (follower, mut learned, ..) = in_motion();
    learned.flow.doubt = 1e5;
    let law = follower.learner().with(learned).law();
    assert_eq!(law.doubt, 1e5);
    // the same load, for which the oil may be stiff or soft
    let soft_below = law.station(0.25).rest.load_pressure + 6e5;
    let at = |doubt: f64| {
        let mut law = law;
        law.stiffness.transition = soft_below;
        law.doubt = doubt;
        law.reckons_at_rest(0.25).gains.position
    };
    assert!(at(8e5) < 0.7 * at(1e5), "{} {}", at(8e5), at(1e5));
}

/// Oil below its transition stiffens within a swing: the same feedback of the pressure would be several times as strong there.
#[test]
fn feedback_of_the_pressure_asks_for_less_where_the_oil_has_stiffened() {
    let mut law = model_following(&Description::uia_single_boom().unwrap()).unwrap();
    let rest = law.station(0.25).rest.load_pressure;
    (law.stiffness.transition, law.doubt) = (rest + 10e5, 0.0);
    let seen = AxisState { stroke: 0.25, velocity: 0.0, load_pressure: rest };
    let at = |bar: f64| law.reckons(&seen, rest + bar * 1e5);
    // what comes back of a pressure, by the oil that is there
    let loops = [0.0, 10.0].map(|bar| {
        let with = at(bar);
        let spring = law.station(0.25).spring(law.stiffness_at(rest + bar * 1e5));
        with.gains.pressure * spring.pressure_by_speed
    });
    // one that knows the oil rises as the frequency at which the crane rings does, one that does not as the stiffness
    let stiffer = law.stiffness_at(rest + 10e5) / law.stiffness_at(rest);
    assert!(loops[1] < stiffer.sqrt() * loops[0], "{loops:?}, {stiffer} times as stiff");
    assert!(at(10.0).gains.pressure < 0.5 * at(0.0).gains.pressure);
    // a pressure that falls is no reason to ask for more
    assert_eq!(at(-10.0), at(0.0));
}

/// An empty boom has nothing to lose, and what a lost load asks of the motor grows with its weight: nothing of the motor waits with either, and from a tenth of the
/// heaviest on it falls evenly, between the payloads for which state feedback is designed, too. A controller that is exported knows of no other payload than the crane file's.
#[test]
fn less_of_the_motor_waits_the_heavier_the_load_that_may_be_lost() {
    let crane = Description::uia_single_boom().unwrap();
    let schedule = schedule(&crane).unwrap();
    let waits = |payload: f64| schedule.at(payload).reserve.share;
    let even = waits(0.25 * schedule.heaviest()) / 15.0;
    for k in 2..20 {
        let [light, heavy] = [k, k + 1].map(|k| 0.05 * f64::from(k) * schedule.heaviest());
        let less = waits(light) - waits(heavy);
        assert!((0.0..=1.2 * even).contains(&less), "{light} kg: {less}");
    }
    assert_eq!([0.0, schedule.heaviest()].map(waits), [0.0; 2]);
    assert!(waits(0.1 * schedule.heaviest()) > 0.1);
    let [own, scheduled] =
        [model_following(&crane).unwrap().reserve.share, waits(crane.numbers.payload)];
    assert!((own - scheduled).abs() < 0.1 * own, "{own} {scheduled}");
}

/// What is known of a crane goes into its description, out of it as overrides, and is what the description then says.
#[test]
fn what_was_learned_makes_a_description_that_says_it() {
    let mut crane = Description::uia_single_boom().unwrap();
    crane.set("pump.slip_l_min_per_bar=0.0002").unwrap();
    let laws = schedule(&crane).unwrap();
    let mut known = in_motion().1.known();
    (known.payload, known.friction) = (crane.numbers.payload, [1.4, 2.6]);
    known.balance.transition = crane.numbers.transition;
    known.balance.leakage = 2.5 * leakage(&crane.numbers, &laws.at(known.payload));
    (known.balance.slip, known.lag) = (3e-14, 12e-3);
    let mut again = crane.clone();
    for assignment in overrides(&crane, &informed(&crane, &laws, &known)) {
        again.set(&assignment).unwrap();
    }
    let n = &again.numbers;
    let leaks = leakage(n, &schedule(&again).unwrap().at(n.payload));
    let pairs = [
        (n.payload, known.payload),
        (n.slip_per_speed, known.balance.slip),
        (n.following_lead, known.lag),
        (n.flow_gain, known.balance.flow_gain),
        (n.coulomb + n.stiction, 1.4 * (crane.numbers.coulomb + crane.numbers.stiction)),
        (n.viscous, 2.6 * crane.numbers.viscous),
        (leaks, known.balance.leakage),
    ];
    for (found, wanted) in pairs {
        // overrides have six digits
        assert!((found / wanted - 1.0).abs() < 1e-4, "{found} for {wanted}");
    }
}

/// What is learned as leakage is what the simulated crane then loses, whatever hangs on it: through orifices and through gaps.
#[test]
fn leakage_is_one_number_for_every_load() {
    for slip in ["0", "0.0005"] {
        let mut crane = Description::uia_single_boom().unwrap();
        crane.set(&format!("pump.slip_l_min_per_bar={slip}")).unwrap();
        let schedule = schedule(&crane).unwrap();
        let flow = balances(&crane, &schedule).flow;
        let n = &crane.numbers;
        for law in &schedule.laws {
            let resting = law.station(0.5 * n.stroke).rest.load_pressure;
            let across = resting + law.beyond_load - n.rod_side;
            let share = flow.before.leakage * flow.leaks(across) / leakage(n, law);
            // orifices are laminar below some bar, and the accumulator takes a little of it in
            assert!((share - 1.0).abs() < 0.02, "{slip}: {share} at {across} Pa");
        }
    }
}

/// A crane file may say that nothing leaks; what is believed of such a crane can be gone on with all the same.
#[test]
fn a_crane_of_which_nothing_is_said_to_leak_learns_too() {
    let mut tight = Description::uia_single_boom().unwrap();
    for key in ["internal_leakage", "case_leakage_a", "case_leakage_b"] {
        tight.set(&format!("pump.{key}_m3_s_sqrtpa=0")).unwrap();
    }
    let flow = balances(&tight, &schedule(&tight).unwrap()).flow;
    let reading = AxisSignals {
        motor_speed: 0.2,
        stroke: 0.2,
        pressure_a: 65e5,
        pressure_pump_a: 65e5,
        ..AxisSignals::default()
    };
    let mut memory = flow.start(&reading);
    for _ in 0..10_000 {
        // the pump turns to hold the load
        flow.update(&mut memory, &reading);
    }
    let believed = memory.believed();
    assert!(memory.balance.leakage > 0.5 * 0.2 * flow.displacement, "{:?}", memory.balance);
    assert!(flow.resume(&believed).is_ok(), "{believed:?}");
}
