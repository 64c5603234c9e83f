//! Table of all known units.
//!
//! Source of factors: BIPM, *The International System of Units*, 9th edition, 2019; NIST Special Publication 811,
//! appendix B (inch, foot, psi, kgf, gallon).

use crate::dimension::Dimension;
use crate::unit::Unit;
use std::f64::consts::{PI, TAU};

/// Atmospheric pressure \[Pa\]: difference of absolute and gauge pressure.
pub(crate) const ATMOSPHERE: f64 = 101_325.0;

const PSI: f64 = 6_894.757_293_168_361;
/// Standard gravity \[m/s²\].
const GRAVITY: f64 = 9.806_65;
const INCH: f64 = 0.0254;
const FOOT: f64 = 0.3048;
const LITRE: f64 = 1e-3;
const GALLON: f64 = 3.785_411_784e-3;

const fn unit(
    name: &'static str,
    dimension: Dimension,
    factor: f64,
    spellings: &'static [&'static str],
) -> Unit {
    Unit { name, dimension, factor, offset: 0.0, spellings }
}

/// A unit of absolute pressure: its offset to gauge pressure is minus one atmosphere.
const fn absolute(name: &'static str, factor: f64, spellings: &'static [&'static str]) -> Unit {
    Unit { name, dimension: Dimension::Pressure, factor, offset: -ATMOSPHERE, spellings }
}

const fn temperature(
    name: &'static str,
    factor: f64,
    offset: f64,
    spellings: &'static [&'static str],
) -> Unit {
    Unit { name, dimension: Dimension::Temperature, factor, offset, spellings }
}

/// The most common unit of a dimension is first. Spellings are in small letters, without blanks, dots and carets.
pub(crate) const UNITS: [Unit; 100] = [
    unit(
        "mm",
        Dimension::Length,
        1e-3,
        &["millimeter", "millimetre", "millimeters", "millimetres"],
    ),
    unit("m", Dimension::Length, 1.0, &["meter", "metre", "meters", "metres"]),
    unit("cm", Dimension::Length, 1e-2, &["centimeter", "centimetre"]),
    unit("dm", Dimension::Length, 1e-1, &[]),
    unit("um", Dimension::Length, 1e-6, &["micron", "micrometer", "micrometre"]),
    unit("in", Dimension::Length, INCH, &["inch", "inches", "\""]),
    unit("ft", Dimension::Length, FOOT, &["foot", "feet"]),
    unit("mm/s", Dimension::Speed, 1e-3, &["mmps", "mms-1"]),
    unit("m/s", Dimension::Speed, 1.0, &["mps", "ms-1"]),
    unit("cm/s", Dimension::Speed, 1e-2, &["cms-1"]),
    unit("m/min", Dimension::Speed, 1.0 / 60.0, &[]),
    unit("mm/min", Dimension::Speed, 1e-3 / 60.0, &[]),
    unit("km/h", Dimension::Speed, 1.0 / 3.6, &["kmh", "kph"]),
    unit("in/s", Dimension::Speed, INCH, &["ips", "inch/s"]),
    unit("ft/s", Dimension::Speed, FOOT, &["fps"]),
    unit("m/s2", Dimension::Acceleration, 1.0, &["m/s/s", "ms-2"]),
    unit("mm/s2", Dimension::Acceleration, 1e-3, &["mms-2"]),
    unit(
        "bar",
        Dimension::Pressure,
        1e5,
        &["barg", "bar(g)", "bar(rel)", "barü", "bar(ü)", "bargauge", "bars"],
    ),
    unit("Pa", Dimension::Pressure, 1.0, &["pascal", "pag", "pa(g)"]),
    unit("mPa", Dimension::Pressure, 1e-3, &[]),
    unit("hPa", Dimension::Pressure, 1e2, &[]),
    unit("kPa", Dimension::Pressure, 1e3, &["kpag", "kpa(g)", "kn/m2"]),
    unit("MPa", Dimension::Pressure, 1e6, &["mpag", "mpa(g)"]),
    unit("GPa", Dimension::Pressure, 1e9, &[]),
    unit("mbar", Dimension::Pressure, 1e2, &["mbarg", "mbar(g)", "millibar"]),
    unit("psi", Dimension::Pressure, PSI, &["psig", "psi(g)", "lbf/in2", "lb/in2", "lbs/in2"]),
    unit("ksi", Dimension::Pressure, 1e3 * PSI, &[]),
    unit("kgf/cm2", Dimension::Pressure, GRAVITY * 1e4, &["kg/cm2", "kp/cm2", "at", "kgcm2"]),
    unit("N/mm2", Dimension::Pressure, 1e6, &["nmm-2"]),
    unit("N/cm2", Dimension::Pressure, 1e4, &[]),
    unit("N/m2", Dimension::Pressure, 1.0, &["nm-2"]),
    unit("atm", Dimension::Pressure, ATMOSPHERE, &[]),
    unit("Torr", Dimension::Pressure, ATMOSPHERE / 760.0, &["mmhg"]),
    absolute("bar abs", 1e5, &["barabs", "bara", "bar(a)", "bar(abs)", "barabsolute"]),
    absolute("psia", PSI, &["psiabs", "psi(a)", "psi(abs)"]),
    absolute("kPa abs", 1e3, &["kpaabs", "kpaa", "kpa(a)", "kpa(abs)"]),
    absolute("MPa abs", 1e6, &["mpaabs", "mpaa", "mpa(a)", "mpa(abs)"]),
    absolute("mbar abs", 1e2, &["mbarabs", "mbara", "mbar(a)", "mbar(abs)"]),
    absolute("hPa abs", 1e2, &["hpaabs", "hpaa", "hpa(a)", "hpa(abs)"]),
    absolute("Pa abs", 1.0, &["paabs", "pa(a)", "pa(abs)"]),
    unit(
        "rpm",
        Dimension::Rotation,
        1.0 / 60.0,
        &["1/min", "rev/min", "u/min", "min-1", "r/min", "tr/min", "/min", "upm", "revs/min"],
    ),
    unit("rev/s", Dimension::Rotation, 1.0, &["rps", "1/s", "u/s", "s-1", "revs/s", "/s"]),
    unit("rad/s", Dimension::Rotation, 1.0 / TAU, &["radps", "rads-1"]),
    unit("deg/s", Dimension::Rotation, 1.0 / 360.0, &["degps", "°/s", "grad/s", "degs-1", "dps"]),
    unit("rad/min", Dimension::Rotation, 1.0 / (60.0 * TAU), &[]),
    unit("deg/min", Dimension::Rotation, 1.0 / 21_600.0, &["°/min"]),
    unit("rad", Dimension::Angle, 1.0, &["radian", "radians"]),
    unit("deg", Dimension::Angle, PI / 180.0, &["°", "degree", "degrees", "grad"]),
    unit("mrad", Dimension::Angle, 1e-3, &[]),
    unit("rev", Dimension::Angle, TAU, &["turn", "turns", "umdr"]),
    unit(
        "s",
        Dimension::Time,
        1.0,
        &["sec", "secs", "second", "seconds", "sek", "sekunden", "sekunde"],
    ),
    unit("ms", Dimension::Time, 1e-3, &["msec", "msecs", "millisecond", "milliseconds", "millis"]),
    unit("us", Dimension::Time, 1e-6, &["usec", "usecs", "microsecond", "microseconds", "micros"]),
    unit("ns", Dimension::Time, 1e-9, &["nsec", "nsecs", "nanosecond", "nanoseconds", "nanos"]),
    unit("min", Dimension::Time, 60.0, &["mins", "minute", "minutes", "minuten"]),
    unit("h", Dimension::Time, 3600.0, &["hr", "hrs", "hour", "hours", "std", "stunden"]),
    unit("d", Dimension::Time, 86_400.0, &["day", "days", "tage"]),
    unit("Hz", Dimension::Frequency, 1.0, &["hertz"]),
    unit("kHz", Dimension::Frequency, 1e3, &[]),
    unit("V", Dimension::Voltage, 1.0, &["volt", "volts", "vdc"]),
    unit("mV", Dimension::Voltage, 1e-3, &["millivolt"]),
    unit("kV", Dimension::Voltage, 1e3, &[]),
    unit("mA", Dimension::Current, 1e-3, &["milliampere"]),
    unit("A", Dimension::Current, 1.0, &["amp", "amps", "ampere"]),
    unit("uA", Dimension::Current, 1e-6, &[]),
    unit("%", Dimension::Share, 1e-2, &["percent", "pct", "prozent", "perc"]),
    unit("-", Dimension::Share, 1.0, &["1", "bool", "boolean", "--"]),
    unit("ppm", Dimension::Share, 1e-6, &[]),
    temperature("degC", 1.0, 273.15, &["°c", "celsius", "c", "gradc"]),
    temperature("K", 1.0, 0.0, &["kelvin"]),
    temperature("degF", 5.0 / 9.0, 459.67 * 5.0 / 9.0, &["°f", "fahrenheit", "f"]),
    unit(
        "L/min",
        Dimension::Flow,
        LITRE / 60.0,
        &["lpm", "lmin-1", "dm3/min", "liter/min", "litre/min", "ltr/min"],
    ),
    unit("m3/s", Dimension::Flow, 1.0, &["m3s-1"]),
    unit("L/s", Dimension::Flow, LITRE, &["ls-1", "dm3/s"]),
    unit("L/h", Dimension::Flow, LITRE / 3600.0, &[]),
    unit("mL/min", Dimension::Flow, 1e-6 / 60.0, &["cm3/min", "ccm/min", "cc/min"]),
    unit("cm3/s", Dimension::Flow, 1e-6, &["ml/s", "cc/s"]),
    unit("m3/h", Dimension::Flow, 1.0 / 3600.0, &[]),
    unit("m3/min", Dimension::Flow, 1.0 / 60.0, &[]),
    unit("gpm", Dimension::Flow, GALLON / 60.0, &["gal/min"]),
    unit("L", Dimension::Volume, LITRE, &["liter", "litre", "dm3"]),
    unit("m3", Dimension::Volume, 1.0, &[]),
    unit("cm3", Dimension::Volume, 1e-6, &["ccm", "ml", "cc"]),
    unit("N", Dimension::Force, 1.0, &["newton"]),
    unit("kN", Dimension::Force, 1e3, &[]),
    unit("MN", Dimension::Force, 1e6, &[]),
    unit("daN", Dimension::Force, 10.0, &[]),
    unit("kgf", Dimension::Force, GRAVITY, &["kp"]),
    unit("lbf", Dimension::Force, PSI * INCH * INCH, &[]),
    unit("Nm", Dimension::Torque, 1.0, &["newtonmeter"]),
    unit("kNm", Dimension::Torque, 1e3, &[]),
    unit("kg", Dimension::Mass, 1.0, &[]),
    unit("g", Dimension::Mass, 1e-3, &["gram"]),
    unit("t", Dimension::Mass, 1e3, &["tonne"]),
    unit("lb", Dimension::Mass, 0.453_592_37, &["lbs"]),
    unit("W", Dimension::Power, 1.0, &["watt"]),
    unit("kW", Dimension::Power, 1e3, &[]),
    unit("MW", Dimension::Power, 1e6, &[]),
    unit("hp", Dimension::Power, 745.699_871_582_270_2, &[]),
    unit("PS", Dimension::Power, 75.0 * GRAVITY, &["cv"]),
];
