//! Sections of a crane file.

/// One table of a crane file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// Name of the table.
    pub name: &'static str,
    /// What its keys describe, as a sentence.
    pub meaning: &'static str,
}

const fn section(name: &'static str, meaning: &'static str) -> Section {
    Section { name, meaning }
}

/// Every section: machine, its equipment, its motion, then controllers and supervision.
pub const SECTIONS: [Section; 41] = [
    section("crane", "Name of the machine."),
    section("circuit", "Actuation of the cylinder, on which other sections depend."),
    section(
        "geometry",
        "Mounts of the cylinder; the bearing A is the origin, x is to the right, y upwards.",
    ),
    section("boom", "Structure, mass and stiffness of the boom."),
    section("link_1", "Link on the bearing, which the cylinder moves."),
    section(
        "link_2",
        "Second link, on an elastic joint with link 1, if `boom.segments` is 2 or 3.",
    ),
    section("link_3", "Third link, on an elastic joint with link 2, if `boom.segments` is 3."),
    section("base", "Base frame that turns elastically about the boom's bearing."),
    section("payload", "Mass and inertia of the payload, and its place on the boom."),
    section("cylinder", "Lift cylinder with its dead volumes and end stops."),
    section("friction", "Friction of the cylinder's seals and guides."),
    section(
        "oil",
        "Bulk modulus over pressure, cavitation, laminar flow at small drops, undissolved air.",
    ),
    section(
        "pump",
        "Pump between both sides of the cylinder: delivery, leakage, losses and ripple.",
    ),
    section(
        "holding_valve",
        "Load-holding valves 3 on both sides of the cylinder, which the switching valve opens.",
    ),
    section(
        "return_valve",
        "Return valves 7 from each pump side to the accumulator, piloted by the other side.",
    ),
    section("check_valve", "Check valves 8, one to the accumulator and one from it."),
    section("lines", "Filter 6 and bleed orifice 10 on the way to the accumulator."),
    section("relief", "Relief valves 13 at the pump sides."),
    section("accumulator", "Accumulator that takes the difference of the cylinder's volumes."),
    section("valve", "Proportional 4/3 valve: spool, metering edges, compensator and leakage."),
    section("hoses", "Hoses between proportional valve and cylinder."),
    section("trapped_air", "Air that is shut in on a side of the cylinder."),
    section("supply", "Pressures of supply and tank line."),
    section("motor", "Limits of the servo motor on the pump."),
    section("drive", "Servo drive between commanded and actual motor speed."),
    section("switching_valve", "3/2 valve that pilots the load-holding valve."),
    section("temperature", "Temperature of the oil and its effect on leakage, friction and air."),
    section("sensors", "Noise, resolution, constant error and bandwidth of the sensors."),
    section("fieldbus", "Delay between controller and machine."),
    section("machine", "Connection to the real machine."),
    section("motion", "Reference of the tests: positions, speeds and ramps of the piston."),
    section("start", "Pressures at the start of a motion."),
    section("oscillation", "Oscillation test with the valve locked."),
    section("virtual", "Time step and random numbers of the virtual crane."),
    section(
        "controller",
        "Gains of the benchmark controller, sample time, and step of the simulation beside the machine.",
    ),
    section("benchmark_design", "Requirements of `hydroboom design --benchmark`."),
    section("estimator", "Tuning of the state estimator, an extended Kalman filter."),
    section("scheduled_lqr", "Tuning of the scheduled LQR."),
    section("tip", "Estimate of the tip's position from piston position and payload."),
    section("learning", "Iterative learning control."),
    section("supervision", "Limits of the supervisor, and times after which it stops the machine."),
];
