//! Every key of a crane file, once: its name with the unit, what it means, what is allowed.

/// One numeric key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Table of the file.
    pub section: &'static str,
    /// Name within the table; its ending is the unit.
    pub name: &'static str,
    /// The unit, as people write it.
    pub unit: &'static str,
    /// Value in SI units of one of these units.
    pub factor: f64,
    /// Smallest value allowed, in this unit.
    pub low: f64,
    /// Largest value allowed, in this unit.
    pub high: f64,
    /// Value, in this unit, where a file does not have the key: that of a crane without the effect.
    /// Keys that have none must be given.
    pub absent: Option<f64>,
    /// Meaning.
    pub meaning: &'static str,
}

impl Key {
    /// `section.name`.
    pub fn path(&self) -> String {
        format!("{}.{}", self.section, self.name)
    }

    /// A value of this unit in SI units.
    pub fn to_si(&self, value: f64) -> f64 {
        value * self.factor
    }

    /// A value in SI units in this unit, free of the conversion's rounding noise.
    pub fn to_unit(&self, value: f64) -> f64 {
        let exact = value / self.factor;
        let shortest: f64 = format!("{exact:.14e}").parse().unwrap_or(exact);
        if self.to_si(shortest) == value || (shortest - exact).abs() <= 1e-14 * exact.abs() {
            shortest
        } else {
            exact
        }
    }
}

macro_rules! keys {
    ($( $field:ident: $section:literal $name:literal [$unit:literal = $factor:expr]
        $low:literal ..= $high:literal $(or $absent:literal)?, $meaning:literal; )+) => {
        /// One value for every numeric key.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Numbers<T> {
            $( #[doc = $meaning] pub $field: T, )+
        }

        /// Every numeric key, in the order of the file.
        pub const KEYS: [Key; [$($low),+].len()] = [$( Key {
            section: $section,
            name: $name,
            unit: $unit,
            factor: $factor,
            low: $low,
            high: $high,
            absent: absent!($($absent)?),
            meaning: $meaning,
        } ),+];

        impl<T: Copy> Numbers<T> {
            /// The numbers in the order of [`KEYS`].
            pub fn to_array(&self) -> [T; KEYS.len()] {
                [$( self.$field ),+]
            }

            /// The numbers from an array in the order of [`KEYS`].
            pub fn from_array([$( $field ),+]: [T; KEYS.len()]) -> Self {
                Self { $( $field ),+ }
            }
        }
    };
}

macro_rules! absent {
    () => {
        None
    };
    ($value:literal) => {
        Some($value)
    };
}

const MM: f64 = 1e-3;
const BAR: f64 = 1e5;
const LITRE: f64 = 1e-3;
const RPM: f64 = 1.0 / 60.0;
const MS: f64 = 1e-3;
const PERCENT: f64 = 1e-2;
/// Degrees Celsius are kept as such: only differences count.
const CELSIUS: f64 = 1.0;

keys! {
    mount_x: "geometry" "mount_x_mm" ["mm" = MM] 1.0..=1e5, "Cylinder mount C along the straight boom, from the bearing A";
    mount_y: "geometry" "mount_y_mm" ["mm" = MM] -1e4..=1e4, "Cylinder mount C across the straight boom, positive upwards";
    base_x: "geometry" "base_x_mm" ["mm" = MM] -1e5..=1e5, "Cylinder foot B on the base, to the right of the bearing";
    base_y: "geometry" "base_y_mm" ["mm" = MM] -1e5..=1e5, "Cylinder foot B on the base, above the bearing";
    shortest: "geometry" "shortest_mm" ["mm" = MM] 10.0..=1e5, "Distance from B to C with the piston at its lower stop";

    boom_length: "boom" "length_mm" ["mm" = MM] 100.0..=1e5, "Length from the bearing to the tip";
    boom_mass: "boom" "mass_kg" ["kg" = 1.0] 0.1..=1e5, "Mass of the boom without payload";
    youngs_modulus: "boom" "youngs_modulus_gpa" ["GPa" = 1e9] 0.01..=2000.0, "Effective modulus of elasticity, E";
    second_moment: "boom" "second_moment_cm4" ["cm4" = 1e-8] 1e-3..=1e9, "Second moment of area of the section, I";
    damping_ratio: "boom" "damping_ratio" ["-" = 1.0] 0.0..=1.0, "Damping ratio of the elastic joints, zeta";
    gravity: "boom" "gravity_m_s2" ["m/s2" = 1.0] 0.0..=100.0, "Acceleration of gravity";

    payload: "payload" "mass_kg" ["kg" = 1.0] 0.0..=1e6, "Mass of the payload";
    payload_x: "payload" "x_mm" ["mm" = MM] 0.0..=1e5, "Payload's centre of mass along the boom, from the bearing";
    payload_y: "payload" "y_mm" ["mm" = MM] -1e4..=1e4, "Payload's centre of mass across the boom, positive upwards";
    payload_inertia: "payload" "inertia_kgm2" ["kg m2" = 1.0] 0.0..=1e7, "Payload's moment of inertia about its centre of mass";

    piston: "cylinder" "piston_mm" ["mm" = MM] 5.0..=1000.0, "Diameter of the piston";
    rod: "cylinder" "rod_mm" ["mm" = MM] 1.0..=1000.0, "Diameter of the rod";
    stroke: "cylinder" "stroke_mm" ["mm" = MM] 5.0..=2e4, "Distance between the end stops";
    dead_volume_a: "cylinder" "dead_volume_a_l" ["L" = LITRE] 0.001..=1000.0, "Oil volume on the piston side at the lower stop, lines included, V_0A";
    dead_volume_b: "cylinder" "dead_volume_b_l" ["L" = LITRE] 0.001..=1000.0, "Oil volume on the rod side at the upper stop, lines included, V_0B";
    stop_stiffness: "cylinder" "stop_stiffness_n_per_mm" ["N/mm" = 1e3] 100.0..=1e8, "Stiffness of the end stops";
    stop_damping: "cylinder" "stop_damping_s_per_m" ["s/m" = 1.0] 0.0..=1000.0, "Damping of the end stops relative to their spring force";

    viscous: "friction" "viscous_ns_per_m" ["N s/m" = 1.0] 0.0..=1e7, "Viscous coefficient, F_v";
    coulomb: "friction" "coulomb_n" ["N" = 1.0] 0.0..=1e6, "Coulomb force, F_C";
    stiction: "friction" "stiction_n" ["N" = 1.0] 0.0..=1e6, "Static force above the Coulomb force, F_S";
    stribeck_velocity: "friction" "stribeck_velocity_mm_s" ["mm/s" = MM] 0.01..=1e4, "Speed over which the static share fades, v_S";
    steepness: "friction" "steepness_s_per_m" ["s/m" = 1.0] 1.0..=1e6, "Steepness of the change of sign at rest, a (law stribeck)";
    bristle_stiffness: "friction" "bristle_stiffness_n_per_mm" ["N/mm" = 1e3] 1.0..=1e8, "Stiffness of the bristles (law lugre)";
    bristle_damping: "friction" "bristle_damping_ns_per_m" ["N s/m" = 1.0] 0.0..=1e8, "Damping of the bristles (law lugre)";

    bulk_modulus_max: "oil" "bulk_modulus_max_mpa" ["MPa" = 1e6] 10.0..=5000.0, "Bulk modulus at high pressure, beta_max";
    bulk_modulus_min: "oil" "bulk_modulus_min_mpa" ["MPa" = 1e6] 0.1..=5000.0, "Bulk modulus near vacuum, beta_min";
    transition: "oil" "transition_bar" ["bar" = BAR] 0.0..=500.0, "Pressure at the middle of the transition, p_const1";
    transition_width: "oil" "transition_width_bar" ["bar" = BAR] 0.1..=500.0, "Width of the transition, p_const2";
    vapour_pressure: "oil" "vapour_pressure_bar" ["bar" = BAR] -1.013..=0.0, "Gauge pressure below which a cavity opens";
    laminar_drop: "oil" "laminar_drop_bar" ["bar" = BAR] 1e-5..=10.0, "Pressure drop below which restrictions are laminar";

    displacement: "pump" "displacement_cm3" ["cm3/rev" = 1e-6] 0.1..=1e4, "Displacement per revolution, K_VP";
    flow_gain: "pump" "flow_gain" ["-" = 1.0] 0.5..=1.0, "k_flow of the published delivery";
    internal_leakage: "pump" "internal_leakage_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 0.0..=1e-5, "Leakage between the pump's sides, K_V,int";
    case_leakage_a: "pump" "case_leakage_a_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 0.0..=1e-5, "Case drain of side A, K_V,extA";
    case_leakage_b: "pump" "case_leakage_b_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 0.0..=1e-5, "Case drain of side B, K_V,extB";
    volume_pump_a: "pump" "volume_a_l" ["L" = LITRE] 0.001..=1000.0, "Volume of pump side A, V_PA";
    volume_pump_b: "pump" "volume_b_l" ["L" = LITRE] 0.001..=1000.0, "Volume of pump side B, V_PB";

    holding_coefficient: "holding_valve" "flow_coefficient_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of load-holding valve 3, fully open";
    holding_cracking: "holding_valve" "cracking_bar" ["bar" = BAR] 0.0..=100.0, "Its cracking pressure, p_cr,3";
    holding_opening: "holding_valve" "opening_bar" ["bar" = BAR] 0.001..=200.0, "Its pressure for full opening, p_o,3";
    holding_ratio: "holding_valve" "pilot_ratio" ["-" = 1.0] 1.0..=50.0, "Its pilot ratio";

    return_coefficient: "return_valve" "flow_coefficient_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of pilot-operated valve 7, fully open";
    return_cracking: "return_valve" "cracking_bar" ["bar" = BAR] 0.0..=100.0, "Its cracking pressure";
    return_opening: "return_valve" "opening_bar" ["bar" = BAR] 0.001..=200.0, "Its pressure for full opening";
    return_ratio: "return_valve" "pilot_ratio" ["-" = 1.0] 1.0..=50.0, "Its pilot ratio";

    check_coefficient: "check_valve" "flow_coefficient_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of check valve 8, fully open";
    check_cracking: "check_valve" "cracking_bar" ["bar" = BAR] 0.0..=100.0, "Its cracking pressure";
    check_opening: "check_valve" "opening_bar" ["bar" = BAR] 0.001..=200.0, "Its pressure for full opening";

    filter: "lines" "filter_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of filter 6";
    bleed_orifice: "lines" "bleed_orifice_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-15..=1e-2, "Flow coefficient of orifice 10";

    relief_coefficient: "relief" "flow_coefficient_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of relief valve 13, fully open";
    relief_cracking: "relief" "cracking_bar" ["bar" = BAR] 1.0..=900.0, "Its cracking pressure";
    relief_opening: "relief" "opening_bar" ["bar" = BAR] 1.0..=900.0, "Its pressure for full opening";

    accumulator_volume: "accumulator" "volume_l" ["L" = LITRE] 0.01..=1e4, "Volume of the shell, V_a";
    precharge: "accumulator" "precharge_bar" ["bar" = BAR] -0.9..=500.0, "Gauge pressure of the gas before filling, p_0";
    working_pressure: "accumulator" "working_bar" ["bar" = BAR] -0.9..=500.0, "Gauge pressure after filling, p_acc,init";
    polytropic_exponent: "accumulator" "polytropic_exponent" ["-" = 1.0] 1.0..=1.7, "Polytropic exponent of the gas, gamma";
    residual_volume: "accumulator" "residual_l" ["L" = LITRE] 0.001..=100.0, "Oil that stays when the bladder rests on its valve";
    atmosphere: "accumulator" "atmosphere_bar" ["bar" = BAR] 0.3..=1.2, "Atmospheric pressure, absolute";

    motor_speed: "motor" "max_speed_rpm" ["rpm" = RPM] 1.0..=1e5, "Largest motor speed";
    motor_slew: "motor" "slew_rpm_per_s" ["rpm/s" = RPM] 1.0..=1e8, "Largest change of motor speed";

    proportional: "controller" "proportional_per_s" ["1/s" = 1.0] 0.0..=1e4, "Proportional gain: piston speed per position error, K_p";
    integral: "controller" "integral_per_s2" ["1/s2" = 1.0] 0.0..=1e6, "Integral gain, K_i";
    pressure_feedback: "controller" "pressure_feedback_m3_per_spa" ["m3/(s Pa)" = 1.0] 0.0..=1e-6, "Pressure feedback: flow per load pressure, k_f";
    high_pass_time: "controller" "high_pass_s" ["s" = 1.0] 1e-3..=1e3, "Time constant of the pressure feedback's high-pass, tau";
    control_period: "controller" "control_period_ms" ["ms" = 1e-3] 0.01..=1000.0, "Sample time of the controller";
    simulation_period: "controller" "simulation_period_us" ["us" = 1e-6] 0.1..=10_000.0, "Step of the simulation beside the machine";

    motion_start: "motion" "start_mm" ["mm" = MM] 0.0..=2e4, "First piston position";
    motion_end: "motion" "end_mm" ["mm" = MM] 0.0..=2e4, "Far piston position";
    slow: "motion" "slow_mm_s" ["mm/s" = MM] 0.01..=1e4, "Speed of the slow test";
    fast: "motion" "fast_mm_s" ["mm/s" = MM] 0.01..=1e4, "Speed of the fast test";
    ramp: "motion" "ramp_s" ["s" = 1.0] 1e-3..=1e4, "Duration of each ramp";
    dwell: "motion" "dwell_s" ["s" = 1.0] 0.0..=1e5, "Rest at the far position";
    rest: "motion" "rest_s" ["s" = 1.0] 0.0..=1e5, "Rest before and after the motion";

    rod_side: "start" "rod_side_bar" ["bar" = BAR] -1.0..=500.0, "Rod-side pressure at the start of a motion";

    oscillation_rod_side: "oscillation" "rod_side_bar" ["bar" = BAR] -1.0..=500.0, "Rod-side pressure trapped in the locked-valve oscillation test";
    oscillation_drop: "oscillation" "drop_mm" ["mm" = MM] 0.001..=1000.0, "Height of the tip above rest from which the boom is dropped";

    preload: "start" "preload_percent" ["%" = PERCENT] 0.0..=100.0 or 100.0, "Pressure of the pump sides at the start of a motion, from the accumulator's (0) to the cylinder's (100)";

    // what a real crane has and the published model leaves out: absent, the effect is off
    base_stiffness: "base" "stiffness_knm_per_rad" ["kN m/rad" = 1e3] 0.0..=1e7 or 0.0, "Stiffness of the base frame against turning; 0 is rigid";
    base_inertia: "base" "inertia_kgm2" ["kg m2" = 1.0] 0.01..=1e6 or 50.0, "Its moment of inertia about the bearing";
    base_damping: "base" "damping_ratio" ["-" = 1.0] 0.0..=2.0 or 0.02, "Its damping ratio";
    base_slack: "base" "slack_mrad" ["mrad" = 1e-3] 0.0..=100.0 or 0.0, "Play of bearings and pins, as an angle to either side";

    slip_at_rest: "pump" "slip_l_min_per_bar" ["L/(min bar)" = 1e-3 / 60.0 / BAR] 0.0..=10.0 or 0.0, "Laminar leakage between the pump's sides at the reference temperature";
    slip_per_speed: "pump" "slip_cm3_per_rev_bar" ["cm3/(rev bar)" = 1e-6 / BAR] 0.0..=1.0 or 0.0, "Its growth with speed";
    torque_loss: "pump" "torque_loss_nm" ["N m" = 1.0] 0.0..=1e4 or 0.0, "Torque lost at any speed";
    torque_loss_share: "pump" "torque_loss_percent" ["%" = PERCENT] 0.0..=100.0 or 0.0, "Torque lost, as a share of the hydraulic torque";
    torque_loss_speed: "pump" "torque_loss_nm_per_1000rpm" ["N m/1000 rpm" = 1e-3 / RPM] 0.0..=1e3 or 0.0, "Torque lost to viscous drag at the reference temperature";
    pistons: "pump" "pistons" ["-" = 1.0] 3.0..=31.0 or 9.0, "Number of pistons, which sets the frequency of the ripple";
    ripple: "pump" "ripple_percent" ["%" = PERCENT] 0.0..=50.0 or 0.0, "Amplitude of the flow ripple, as a share of the flow";

    drive_bandwidth: "drive" "bandwidth_hz" ["Hz" = 1.0] 0.0..=1e4 or 0.0, "Undamped frequency of the servo drive's second-order lag; 0 follows at once";
    drive_damping: "drive" "damping_ratio" ["-" = 1.0] 0.1..=10.0 or 0.8, "Its damping ratio";
    drive_torque: "drive" "max_torque_nm" ["N m" = 1.0] 0.1..=1e6 or 1e6, "Largest torque of the motor";
    drive_inertia: "drive" "inertia_kgm2" ["kg m2" = 1.0] 1e-6..=1e3 or 1e-6, "Moment of inertia of motor and pump";

    air_shift: "oil" "air_shift_bar" ["bar" = BAR] 0.0..=100.0 or 0.0, "How far the transition falls once the oil has dissolved its air; 0 is no hysteresis";
    air_dissolving: "oil" "air_dissolving_s" ["s" = 1.0] 1e-3..=1e5 or 20.0, "Time constant of air dissolving under pressure";
    air_releasing: "oil" "air_releasing_s" ["s" = 1.0] 1e-3..=1e5 or 2.0, "Time constant of air coming out again";

    valve_delay: "switching_valve" "delay_ms" ["ms" = MS] 0.0..=1e4 or 0.0, "Time from the command of the 3/2 valve to its first effect";
    pilot_line: "switching_valve" "pilot_line_ms" ["ms" = MS] 0.0..=1e4 or 0.0, "Time constant of the pilot lines filling";

    oil_temperature: "temperature" "oil_c" ["C" = CELSIUS] -40.0..=120.0 or 40.0, "Oil temperature at the start";
    reference_temperature: "temperature" "reference_c" ["C" = CELSIUS] -40.0..=120.0 or 40.0, "Oil temperature at which leakage and friction have their stated values";
    ambient_temperature: "temperature" "ambient_c" ["C" = CELSIUS] -60.0..=80.0 or 20.0, "Temperature of the surroundings";
    heat_capacity: "temperature" "heat_capacity_kj_per_k" ["kJ/K" = 1e3] 0.0..=1e6 or 0.0, "Heat capacity of oil and circuit; 0 keeps the oil's temperature";
    cooling: "temperature" "cooling_w_per_k" ["W/K" = 1.0] 0.0..=1e6 or 0.0, "Heat given off for each degree above the surroundings";
    viscosity_slope: "temperature" "viscosity_per_k" ["1/K" = 1.0] 0.0..=0.2 or 0.0, "Relative loss of viscosity with each degree";
    air_slope: "temperature" "transition_bar_per_k" ["bar/K" = BAR] -5.0..=5.0 or 0.0, "Change of oil.transition_bar with each degree, as the oil holds less air";

    position_noise: "sensors" "position_noise_mm" ["mm" = MM] 0.0..=100.0 or 0.0, "Noise of the position encoder, RMS";
    position_resolution: "sensors" "position_resolution_mm" ["mm" = MM] 0.0..=100.0 or 0.0, "Its smallest step";
    pressure_span: "sensors" "pressure_span_bar" ["bar" = BAR] 1.0..=1e4 or 250.0, "Span of the pressure transducers";
    pressure_error: "sensors" "pressure_error_percent" ["%" = PERCENT] 0.0..=10.0 or 0.0, "Their constant error: half-width of the range it is drawn from, of span";
    pressure_noise: "sensors" "pressure_noise_percent" ["%" = PERCENT] 0.0..=10.0 or 0.0, "Their noise, RMS, of span";
    pressure_bits: "sensors" "pressure_bits" ["bit" = 1.0] 0.0..=32.0 or 0.0, "Resolution of their analogue input over the span; 0 is none";
    sensor_bandwidth: "sensors" "bandwidth_hz" ["Hz" = 1.0] 0.0..=1e5 or 0.0, "Bandwidth of all sensors; 0 is unlimited";

    fieldbus_delay: "fieldbus" "delay_cycles" ["cycles" = 1.0] 0.0..=100.0 or 0.0, "Control cycles from command to drive, and again from sensor to controller";

    virtual_step: "virtual" "step_us" ["us" = 1e-6] 0.0..=5000.0 or 0.0, "Step of the implicit scheme for the virtual crane; 0 takes the published scheme at controller.simulation_period_us";
    seed: "virtual" "seed" ["-" = 1.0] 0.0..=9e15 or 0.0, "Seed of all that is drawn: noise, and the sensors' constant errors";
}

/// The choices of a crane file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choices {
    /// `friction.law`.
    pub friction: FrictionChoice,
    /// `pump.delivery`.
    pub delivery: DeliveryChoice,
    /// `motion.profile`.
    pub profile: ProfileChoice,
    /// `relief.valves`.
    pub relief: ReliefChoice,
}

macro_rules! choice {
    ($(#[$meta:meta])* $Name:ident: $path:literal { $( $(#[doc = $doc:literal])* $Variant:ident = $text:literal, )+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $Name { $( $(#[doc = $doc])* $Variant, )+ }

        impl $Name {
            /// `section.name` of the key.
            pub const PATH: &'static str = $path;
            /// What the file may say.
            pub const ALLOWED: &'static [&'static str] = &[$($text),+];

            /// The choice with this name.
            pub fn from_name(name: &str) -> Option<Self> {
                match name { $( $text => Some(Self::$Variant), )+ _ => None }
            }

            /// Its name.
            pub fn name(self) -> &'static str {
                match self { $( Self::$Variant => $text, )+ }
            }
        }
    };
}

choice! {
    /// The friction law.
    FrictionChoice: "friction.law" {
        /// The published one.
        Stribeck = "stribeck",
        /// With friction at rest.
        LuGre = "lugre",
    }
}
choice! {
    /// How the pump's k_flow is found.
    DeliveryChoice: "pump.delivery" {
        /// The constant `pump.flow_gain`.
        Published = "published",
        /// From the pressures at every step.
        Computed = "computed",
    }
}
choice! {
    /// The shape of the motion's ramps.
    ProfileChoice: "motion.profile" {
        /// Linear ramps, as published.
        Trapezoidal = "trapezoidal",
        /// Jerk-limited ramps.
        SCurve = "s-curve",
    }
}
choice! {
    /// Whether relief valves 13 are modelled.
    ReliefChoice: "relief.valves" {
        /// None, as published.
        None = "none",
        /// One at each pump side.
        Fitted = "fitted",
    }
}
