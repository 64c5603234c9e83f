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
        $low:literal ..= $high:literal, $meaning:literal; )+) => {
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

const MM: f64 = 1e-3;
const BAR: f64 = 1e5;
const LITRE: f64 = 1e-3;
const RPM: f64 = 1.0 / 60.0;

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
