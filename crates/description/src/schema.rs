//! All keys of a crane file: name with unit, meaning, and allowed values.

mod applicability;
mod choice;
mod key;

pub(crate) use applicability::LINKS;
pub use choice::{
    ChoiceKey, Choices, CircuitChoice, DeliveryChoice, FrictionChoice, HoldingCheckChoice,
    PositionSwitchChoice, ProfileChoice, ReliefChoice, StructureChoice,
};
pub use key::Key;

macro_rules! keys {
    (
        machine {
            $( $field:ident: $section:literal $name:literal [$unit:literal = $factor:expr]
                $($whole:ident)? $low:literal ..= $high:literal $(or $absent:literal)?, $meaning:literal; )+
        }
        tuning {
            $( $t_field:ident: $t_section:literal $t_name:literal [$t_unit:literal = $t_factor:expr]
                $($t_whole:ident)? $t_low:literal ..= $t_high:literal or $t_absent:literal, $t_meaning:literal; )+
        }
        motion_and_equipment {
            $( $m_field:ident: $m_section:literal $m_name:literal [$m_unit:literal = $m_factor:expr]
                $($m_whole:ident)? $m_low:literal ..= $m_high:literal $(or $m_absent:literal)?, $m_meaning:literal; )+
        }
    ) => {
        /// Values of all numeric keys, in SI units. Name, unit, limits and meaning of each are in [`KEYS`].
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Numbers<T> {
            $( #[doc = $meaning] pub $field: T, )+
            /// Tuning of state estimator and scheduled LQR
            pub tuning: Tuning<T>,
            $( #[doc = $m_meaning] pub $m_field: T, )+
        }

        /// Every number of state estimator (`[estimator]`) and scheduled LQR (`[scheduled_lqr]`), in SI units. Unit,
        /// range, default and source of each are in [`KEYS`]. None of them depends on a single crane: a crane file
        /// seldom has one.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Tuning<T> {
            $( #[doc = $t_meaning] pub $t_field: T, )+
        }

        /// Every numeric key, in the order of the file.
        pub const KEYS: [Key; [$($low,)+ $($t_low,)+ $($m_low),+].len()] = [
            $( key!($section $name $unit $factor, ($($whole)?) $low $high ($($absent)?) $meaning), )+
            $( key!($t_section $t_name $t_unit $t_factor, ($($t_whole)?) $t_low $t_high ($t_absent) $t_meaning), )+
            $( key!($m_section $m_name $m_unit $m_factor, ($($m_whole)?) $m_low $m_high ($($m_absent)?) $m_meaning) ),+
        ];

        impl<T: Copy> Numbers<T> {
            /// The numbers in the order of [`KEYS`].
            pub fn to_array(&self) -> [T; KEYS.len()] {
                [$( self.$field, )+ $( self.tuning.$t_field, )+ $( self.$m_field ),+]
            }

            /// The numbers from an array in the order of [`KEYS`].
            pub fn from_array(
                [$( $field, )+ $( $t_field, )+ $( $m_field ),+]: [T; KEYS.len()],
            ) -> Self {
                Self { $( $field, )+ tuning: Tuning { $( $t_field ),+ }, $( $m_field ),+ }
            }
        }
    };
}

macro_rules! key {
    ($section:literal $name:literal $unit:literal $factor:expr, ($($whole:ident)?) $low:literal $high:literal ($($absent:literal)?) $meaning:literal) => {
        Key {
            section: $section,
            name: $name,
            unit: $unit,
            factor: $factor,
            is_whole: is_whole!($($whole)?),
            low: $low,
            high: $high,
            absent: absent!($($absent)?),
            meaning: $meaning,
        }
    };
}

/// `whole` before a key's limits allows whole numbers only.
macro_rules! is_whole {
    () => {
        false
    };
    (whole) => {
        true
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
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Degrees Celsius are kept as such: only differences count.
const CELSIUS: f64 = 1.0;

keys! {
machine {
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
}
tuning {
    estimator_position_noise: "estimator" "position_noise_mm" ["mm" = MM] 1e-4..=10.0 or 0.011, "Position measurement beside the sensor's data sheet: boom modes and pump ripple that the reduced model leaves out, RMS; estimate";
    estimator_pressure_noise: "estimator" "pressure_noise_bar" ["bar" = BAR] 1e-4..=50.0 or 0.05, "The same of the load pressure; estimate, by the mean NIS of virtual cranes";
    estimator_noise_memory: "estimator" "noise_memory_s" ["s" = 1.0] 0.1..=1000.0 or 5.0, "Averaging time of the measured noise; long beside a load change";
    estimator_initial_position: "estimator" "initial_position_mm" ["mm" = MM] 1e-6..=100.0 or 0.02, "Standard deviation of the load's position at the start: noise and compliance; estimate";
    estimator_initial_velocity: "estimator" "initial_velocity_mm_s" ["mm/s" = MM] 1e-6..=1e4 or 0.5, "Standard deviation of the load's velocity at the start, at rest; estimate";
    estimator_initial_pressure: "estimator" "initial_pressure_bar" ["bar" = BAR] 1e-4..=100.0 or 0.1, "Standard deviation of the load pressure at the start; measurement noise";
    estimator_position_drift: "estimator" "position_drift_mm" ["mm" = MM] 1e-6..=10.0 or 0.01, "Process noise of the load's position in a second: half a boom mode's amplitude; estimate";
    estimator_velocity_drift: "estimator" "velocity_drift_mm_s" ["mm/s" = MM] 1e-4..=1000.0 or 1.0, "Process noise of the load's velocity in a second; estimate";
    estimator_flow_ripple: "estimator" "flow_ripple_rev" ["rev" = 1.0] 1e-6..=10.0 or 0.03, "Process noise of the delivered flow: standard deviation of what is pumped in a second, in revolutions; pump ripple, 1 bar where the oil is stiff";
    estimator_friction_drift: "estimator" "friction_drift_bar" ["bar" = BAR] 1e-4..=100.0 or 0.3, "Process noise of friction over the piston's area in a second; estimate";
    estimator_disturbance_drift: "estimator" "disturbance_drift_bar" ["bar" = BAR] 1e-3..=100.0 or 1.5, "Process noise of the unknown force over the piston's area in a second; twice as much makes the motor noisy";
    estimator_initial_disturbance: "estimator" "initial_disturbance_bar" ["bar" = BAR] 1e-3..=100.0 or 2.0, "Standard deviation of the unknown force at the start: friction of the crane file and half as much again";
    estimator_disturbance_time: "estimator" "disturbance_time_s" ["s" = 1.0] 0.05..=100.0 or 1.0, "Time in which an unknown force decays; what lasts longer is taken for payload";
    estimator_largest_disturbance: "estimator" "largest_disturbance_bar" ["bar" = BAR] 1.0..=1e4 or 150.0, "Largest unknown force over the piston's area that is estimated; twice the heaviest load of the paper's crane";
    estimator_largest_friction: "estimator" "largest_friction" ["-" = 1.0] 1.0..=100.0 or 4.0, "Largest friction that is estimated, over Coulomb friction of the crane file";
    estimator_largest_velocity: "estimator" "largest_velocity_mm_s" ["mm/s" = MM] 1.0..=1e6 or 10_000.0, "Largest velocity that is estimated: beyond what any crane does";
    estimator_largest_pressure: "estimator" "largest_pressure_bar" ["bar" = BAR] 1.0..=1e4 or 1000.0, "Largest load pressure that is estimated: beyond what any cylinder bears";
    estimator_flow_drift: "estimator" "flow_drift_rpm" ["rpm" = RPM] 1e-3..=1000.0 or 18.0, "Process noise of the unknown flow in a second, as a motor speed; estimate";
    estimator_least_leakage: "estimator" "least_leakage_deviation" ["-" = 1.0] 0.01..=100.0 or 0.5, "Least standard deviation of the unknown flow at the start, over the leakage of the crane file: worn as its range says";
    estimator_most_leakage: "estimator" "most_leakage_deviation" ["-" = 1.0] 0.01..=1000.0 or 10.0, "Most of the same";
    estimator_largest_flow: "estimator" "largest_flow_percent" ["%" = PERCENT] 0.01..=100.0 or 40.0, "Largest unknown flow that is estimated, of the motor's speed; a pump worn out";
    estimator_payload_drift: "estimator" "payload_drift_percent" ["%" = PERCENT] 1e-3..=100.0 or 1.0, "Process noise of the payload in a second, of the heaviest that is thought of; estimate";
    estimator_payload_variance_limit: "estimator" "payload_variance_limit" ["-" = 1.0] 1.0..=1e6 or 30.0, "Largest variance of the payload in the filter, over that at the start";
    estimator_transition_drift: "estimator" "transition_drift_bar" ["bar" = BAR] 1e-3..=100.0 or 2.0, "Process noise of the oil's transition pressure in a second: air dissolves within seconds";
    estimator_excitation_velocity: "estimator" "excitation_velocity_mm_s" ["mm/s" = MM] 0.0..=1000.0 or 2.0, "Velocity of the load below which the transition pressure has no process noise, since nothing excites the oil; a tenth of slow motion; 0: noise always";
    estimator_lowest_transition: "estimator" "lowest_transition_bar" ["bar" = BAR] 0.0..=500.0 or 8.0, "Lowest transition pressure that is estimated; oil without undissolved air";
    estimator_highest_transition: "estimator" "highest_transition_bar" ["bar" = BAR] 0.1..=500.0 or 65.0, "Highest transition pressure that is estimated; oil with a tenth of air";
    estimator_nis_time: "estimator" "nis_time_ms" ["ms" = MS] 1.0..=10_000.0 or 25.0, "Time constant of the mean of normalised innovations squared (NIS)";
    estimator_nis_threshold: "estimator" "nis_threshold" ["-" = 1.0] 1.1..=100.0 or 3.0, "Mean NIS above which a load has changed: three times what it is without a change";
    estimator_nis_inconsistent: "estimator" "nis_inconsistent" ["-" = 1.0] 1.1..=1000.0 or 6.0, "Mean NIS above which the innovations are not explained: twice the threshold";
    estimator_nis_certain: "estimator" "nis_certain" ["-" = 1.0] 1.1..=1000.0 or 15.0, "Mean NIS from which a load change is certain: five times the threshold; between the two, reported bounds open linearly";
    estimator_divergence_time: "estimator" "divergence_time_s" ["s" = 1.0] 0.01..=100.0 or 2.0, "Time of a mean NIS above nis_inconsistent after which the filter has diverged, and the benchmark takes over";
    estimator_drive_lag: "estimator" "drive_lag_ms" ["ms" = MS] 1.0..=300.0 or 6.2, "Lag of the servo drive before any is identified";
    estimator_drive_memory: "estimator" "drive_memory_s" ["s" = 1.0] 0.1..=1000.0 or 2.0, "Time constant in which the identification of the drive forgets";
    estimator_drive_deviation: "estimator" "drive_deviation_percent" ["%" = PERCENT] 0.1..=100.0 or 10.0, "Standard deviation of the share of the way to its command that the motor goes in a period: at the start, and at most";
    estimator_shortest_drive_lag: "estimator" "shortest_drive_lag_ms" ["ms" = MS] 0.1..=300.0 or 1.7, "Shortest lag of the drive that is identified: 94 Hz";
    estimator_longest_drive_lag: "estimator" "longest_drive_lag_ms" ["ms" = MS] 1.0..=10_000.0 or 200.0, "Longest lag of the drive that is identified: 0.8 Hz";
    estimator_free_slew: "estimator" "free_slew_percent" ["%" = PERCENT] 1.0..=100.0 or 80.0, "Change of the motor's speed up to which its lag is identified, of the slew limit";
    estimator_speed_noise: "estimator" "speed_noise_rpm" ["rpm" = RPM] 0.01..=1000.0 or 12.0, "Noise of the motor speed that is read, and of what a first-order lag leaves out of the drive";
    estimator_mass_deviation: "estimator" "mass_deviation_percent" ["%" = PERCENT] 0.0..=100.0 or 5.0, "Standard deviation of the equivalent mass about that of the model; considered, not estimated: base and modes that the reduced model leaves out; estimate";
    estimator_payload_position: "estimator" "payload_position_deviation_mm" ["mm" = MM] 0.0..=1e4 or 60.0, "Standard deviation of the load's centre of mass along the boom about payload.x_mm; considered, not estimated: pressure shows the load's moment, not its mass; a load within 0.1 m to either side, estimate";
    estimator_sensor_lag: "estimator" "sensor_lag_deviation_ms" ["ms" = MS] 0.0..=100.0 or 0.1, "Standard deviation of the position sensor's lag about that of its data sheet; considered, not estimated: a typical bandwidth is not known better";

    lqr_position: "scheduled_lqr" "position_tolerance_mm" ["mm" = MM] 1e-3..=1000.0 or 1.0, "Position error that costs one (Bryson); only ratios of the three tolerances count";
    lqr_velocity: "scheduled_lqr" "velocity_tolerance_mm_s" ["mm/s" = MM] 1e-3..=1e4 or 40.0, "Velocity error that costs one; damping of the load's mode";
    lqr_command: "scheduled_lqr" "command_tolerance_mm_s" ["mm/s" = MM] 1e-3..=1e4 or 23.0, "Piston velocity commanded beyond the feedforward that costs one; less gives lower gains and less motor activity";
    lqr_feedback: "scheduled_lqr" "feedback_percent" ["%" = PERCENT] 1.0..=100.0 or 40.0, "Largest speed that feedback may command, of the motor's";
    lqr_position_feedback: "scheduled_lqr" "position_feedback_percent" ["%" = PERCENT] 1.0..=100.0 or 20.0, "Largest speed that feedback of the position may command, of the motor's (nested saturation)";
    lqr_filling: "scheduled_lqr" "filling_percent" ["%" = PERCENT] 1.0..=100.0 or 20.0, "Largest motor speed that filling the oil may take along the reference, of the motor's; sets the smoothing window";
    lqr_filling_friction: "scheduled_lqr" "filling_friction_percent" ["%" = PERCENT] 0.0..=200.0 or 50.0, "Friction whose change of sign is filled within the smoothing window, of Coulomb friction";
    lqr_shortest_window: "scheduled_lqr" "shortest_window_ms" ["ms" = MS] 2.0..=300.0 or 15.0, "Shortest smoothing window of the reference, beside the drive's lag";
    lqr_longest_window: "scheduled_lqr" "longest_window_ms" ["ms" = MS] 2.0..=400.0 or 400.0, "Longest smoothing window of the reference; at a control period of 1 ms the preview keeps 300 ms of the past, of which this takes 280";
    lqr_window_time: "scheduled_lqr" "window_time_ms" ["ms" = MS] 1.0..=10_000.0 or 200.0, "Time constant in which the smoothing window adapts";
    lqr_governor_error: "scheduled_lqr" "governor_error_mm" ["mm" = MM] 1e-2..=1e4 or 4.0, "Largest tracking error that is left to feedback; beyond it the reference is offset so that the error equals it";
    lqr_governor_rate: "scheduled_lqr" "governor_rate_per_s" ["1/s" = 1.0] 0.01..=100.0 or 1.5, "Largest rate at which the reference returns";
    lqr_governor_rate_by_mode: "scheduled_lqr" "governor_rate_by_mode" ["-" = 1.0] 0.01..=10.0 or 0.8, "The same over the natural frequency of the load";
    lqr_governor_speed: "scheduled_lqr" "governor_speed_percent" ["%" = PERCENT] 1.0..=100.0 or 40.0, "Largest speed at which the reference returns, of the motor's";
    lqr_rollout_horizon: "scheduled_lqr" "rollout_horizon_ms" ["ms" = MS] 50.0..=780.0 or 500.0, "Horizon of the policy improvement: a period and a half of the slowest load mode";
    lqr_rollout_short: "scheduled_lqr" "rollout_short_ms" ["ms" = MS] 1.0..=500.0 or 30.0, "Short time for which an alternative holds the motor's limit";
    lqr_rollout_long: "scheduled_lqr" "rollout_long_ms" ["ms" = MS] 1.0..=500.0 or 100.0, "Long time for which an alternative holds the motor's limit: about that to reach it at the slew limit";
    lqr_rollout_improvement: "scheduled_lqr" "rollout_improvement_percent" ["%" = PERCENT] 0.0..=100.0 or 1.0, "An alternative must cost less than the law by this share";
    lqr_rollout_offset: "scheduled_lqr" "rollout_offset_mm" ["mm" = MM] 1e-3..=100.0 or 0.1, "Offset of the governed reference from the asked one beyond which alternatives are predicted";
    lqr_payload_probability: "scheduled_lqr" "payload_probability_percent" ["%" = PERCENT] 0.0..=100.0 or 70.0, "Probability that a load that has changed is a payload, and not a force";
}
motion_and_equipment {
    // the tip's position: before a survey its numbers have a stated spread, after one that of their fit (`hydroboom
    // tip`)
    tip_bending: "tip" "bending_percent" ["%" = PERCENT] 1.0..=1000.0 or 100.0, "Bending of the boom under load, of that of a uniform beam of the crane file's E I";
    tip_bending_deviation: "tip" "bending_deviation_percent" ["%" = PERCENT] 0.0..=100.0 or 20.0, "Its standard deviation; unsurveyed, E I and play of joints of a welded box section";
    tip_base: "tip" "base_mrad_per_knm" ["mrad/(kN m)" = 1e-6] -10.0..=100.0 or 0.06, "Compliance of the base against turning about the boom's bearing; unsurveyed, a steel column of 1 m, square hollow section of 200 to 300 mm";
    tip_base_deviation: "tip" "base_deviation_mrad_per_knm" ["mrad/(kN m)" = 1e-6] 0.0..=100.0 or 0.04, "Its standard deviation";
    tip_offset: "tip" "stroke_offset_mm" ["mm" = MM] -100.0..=100.0 or 0.0, "What is added to the piston position that is read, for the tip";
    tip_offset_deviation: "tip" "stroke_offset_deviation_mm" ["mm" = MM] 0.0..=100.0 or 0.3, "Its standard deviation; unsurveyed, zero of the encoder and lengths of the mounts";
    tip_bending_base: "tip" "bending_base_correlation" ["-" = 1.0] -1.0..=1.0 or 0.0, "Correlation of the errors of bending and base compliance, by a survey";
    tip_bending_offset: "tip" "bending_offset_correlation" ["-" = 1.0] -1.0..=1.0 or 0.0, "The same of bending and stroke offset";
    tip_base_offset: "tip" "base_offset_correlation" ["-" = 1.0] -1.0..=1.0 or 0.0, "The same of base compliance and stroke offset";
    tip_payload_memory: "tip" "payload_memory_s" ["s" = 1.0] 0.01..=1e5 or 20.0, "Time constant of the payload's mean for the tip: about a cycle, in which friction changes its sign";
    benchmark_sensitivity_peak: "benchmark_design" "sensitivity_peak" ["-" = 1.0] 1.1..=3.0 or 1.7, "Largest sensitivity M_s that `hydroboom design --benchmark` allows: 1.2 to 2.0 are usual; gain margin of 2.4 and phase margin of 34 degrees at least";
    benchmark_untuned_peak: "benchmark_design" "untuned_peak" ["-" = 1.0] 1.2..=10.0 or 2.0, "Largest sensitivity from which gains count as not tuned for a crane, and designed ones take their place in comparisons";
    benchmark_largest_droop: "benchmark_design" "largest_droop_mm_per_bar" ["mm/bar" = MM / BAR] 0.01..=1000.0 or 1.0, "Largest droop of the piston by pressure feedback, k_f tau/A_p for a bar of load pressure that lasts; 1.5 with the paper's gains; by motions of odd cranes, of which more costs tracking";
    benchmark_longest_high_pass: "benchmark_design" "longest_high_pass_s" ["s" = 1.0] 0.01..=100.0 or 2.0, "Longest time constant of its high-pass: what is slower, pressure feedback lets the piston sag under a load that moves";
    tip_remainder: "tip" "remainder_mm" ["mm" = MM] 0.0..=1000.0 or 0.2, "Standard deviation, across the boom, of what these numbers leave out: the boom's modes, shape of the load; estimate, by virtual cranes";

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

    learning_knots: "learning" "knot_periods" ["-" = 1.0] 1.0..=20.0 or 2.0, "Interval of the knots of a correction by iterative learning control, in periods of the load on boom and oil at its lowest frequency along the course; with two a correction hardly excites that mode; below 1.5 convergence is lost within the usual range of payloads";
    learning_change: "learning" "change_weight_mm_s_per_rev" ["mm s/rev" = MM] 0.0..=100.0 or 0.1, "Weight of the correction's change, rho, as the position error that a change of 1 rev/s is worth; the larger, the slower and the more robust; estimate";
    learning_size: "learning" "size_weight_mm_s_per_rev" ["mm s/rev" = MM] 1e-4..=100.0 or 0.05, "Weight of the correction itself, mu, as the position error that 1 rev/s is worth: it bounds what the error hardly shows; estimate";
    learning_average: "learning" "average_ms" ["ms" = MS] 0.0..=1000.0 or 25.0, "Half the length of the moving average over the measured error, against the position sensor's noise: -3 dB at 0.22 over it, 8.9 Hz";
    learning_cycles: "learning" "cycles" ["-" = 1.0] whole 1.0..=100.0 or 10.0, "Cycles of learning; of a machine that repeats itself the error has settled after three";
    learning_corners: "learning" "corner_points" ["-" = 1.0] whole 1.0..=11.0 or 2.0, "Points in each of the ranges of payload and of the oil's transition pressure at which convergence is required, each with each: 2 are the ends of the ranges, 1 is the model alone";

    // effects of real cranes beyond the published model: a key that is left out switches its effect off
    base_stiffness: "base" "stiffness_knm_per_rad" ["kN m/rad" = 1e3] 0.0..=1e7 or 0.0, "Stiffness of the base frame against turning; 0 is rigid";
    base_inertia: "base" "inertia_kgm2" ["kg m2" = 1.0] 0.01..=1e6 or 50.0, "Its moment of inertia about the bearing";
    base_damping: "base" "damping_ratio" ["-" = 1.0] 0.0..=2.0 or 0.02, "Its damping ratio";
    base_slack: "base" "slack_mrad" ["mrad" = 1e-3] 0.0..=100.0 or 0.0, "Play of bearings and pins, as an angle to either side";

    slip_at_rest: "pump" "slip_l_min_per_bar" ["L/(min bar)" = 1e-3 / 60.0 / BAR] 0.0..=10.0 or 0.0, "Laminar leakage between the pump's sides at the reference temperature";
    slip_per_speed: "pump" "slip_cm3_per_rev_bar" ["cm3/(rev bar)" = 1e-6 / BAR] 0.0..=1.0 or 0.0, "Its growth with speed";
    torque_loss: "pump" "torque_loss_nm" ["N m" = 1.0] 0.0..=1e4 or 0.0, "Torque lost at any speed";
    torque_loss_share: "pump" "torque_loss_percent" ["%" = PERCENT] 0.0..=100.0 or 0.0, "Torque lost, as a share of the hydraulic torque";
    torque_loss_speed: "pump" "torque_loss_nm_per_1000rpm" ["N m/1000 rpm" = 1e-3 / RPM] 0.0..=1e3 or 0.0, "Torque lost to viscous drag at the reference temperature";
    pistons: "pump" "pistons" ["-" = 1.0] whole 3.0..=31.0 or 9.0, "Number of pistons, which sets the frequency of the ripple";
    ripple: "pump" "ripple_percent" ["%" = PERCENT] 0.0..=50.0 or 0.0, "Amplitude of the flow ripple, as a share of the flow";

    drive_bandwidth: "drive" "bandwidth_hz" ["Hz" = 1.0] 0.0..=1e4 or 0.0, "Undamped frequency of the servo drive's second-order lag; 0 follows at once";
    drive_damping: "drive" "damping_ratio" ["-" = 1.0] 0.1..=10.0 or 0.8, "Its damping ratio";
    drive_dead_time: "drive" "dead_time_ms" ["ms" = MS] 0.0..=300.0 or 0.0, "Its dead time, from a command that arrives to the first effect on the speed: cycles of the drive's own control; typical 0 to 10; identified by `tune` and `learn`";
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
    pressure_bits: "sensors" "pressure_bits" ["bit" = 1.0] whole 0.0..=32.0 or 0.0, "Resolution of their analogue input over the span; 0 is none";
    sensor_bandwidth: "sensors" "bandwidth_hz" ["Hz" = 1.0] 0.0..=1e5 or 0.0, "Bandwidth of all sensors; 0 is unlimited";

    fieldbus_delay: "fieldbus" "delay_cycles" ["cycles" = 1.0] whole 0.0..=20.0 or 0.0, "Control cycles from command to drive, and again from sensor to controller";

    spool_neutral: "valve" "neutral_v" ["V" = 1.0] -100.0..=100.0, "Command of the valve's middle position";
    spool_full: "valve" "full_lift_v" ["V" = 1.0] -100.0..=100.0, "Command of full travel to lift";
    spool_bandwidth: "valve" "bandwidth_hz" ["Hz" = 1.0] 0.1..=1e4, "Undamped frequency of the spool";
    spool_damping: "valve" "damping_ratio" ["-" = 1.0] 0.1..=10.0, "Its damping ratio";
    compensated_drop: "valve" "compensated_drop_bar" ["bar" = BAR] 0.1..=1000.0, "Largest drop that the pressure compensator leaves on the edges from the supply; as large as the supply's pressure, there is none";
    supply_to_a: "valve" "supply_to_a_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of the edge from the supply to the piston side, fully open";
    supply_to_a_band: "valve" "supply_to_a_dead_band_percent" ["%" = PERCENT] 0.0..=99.0, "Its overlap, as a share of the travel";
    supply_to_b: "valve" "supply_to_b_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of the edge from the supply to the rod side, fully open";
    supply_to_b_band: "valve" "supply_to_b_dead_band_percent" ["%" = PERCENT] 0.0..=99.0, "Its overlap, as a share of the travel";
    a_to_tank: "valve" "a_to_tank_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of the edge from the piston side to the tank, fully open";
    a_to_tank_band: "valve" "a_to_tank_dead_band_percent" ["%" = PERCENT] 0.0..=99.0, "Its overlap, as a share of the travel";
    b_to_tank: "valve" "b_to_tank_m3_s_sqrtpa" ["m3/(s Pa^0.5)" = 1.0] 1e-12..=1e-2, "Flow coefficient of the edge from the rod side to the tank, fully open";
    b_to_tank_band: "valve" "b_to_tank_dead_band_percent" ["%" = PERCENT] 0.0..=99.0, "Its overlap, as a share of the travel";
    valve_leakage: "valve" "leakage_l_min_per_bar" ["L/(min bar)" = 1e-3 / 60.0 / BAR] 0.0..=10.0, "Leakage past piston and spool from the piston side to the rod side";
    hose_a: "hoses" "volume_a_l" ["L" = LITRE] 1e-6..=100.0, "Oil in the hose of the piston side";
    hose_b: "hoses" "volume_b_l" ["L" = LITRE] 1e-6..=100.0, "Oil in the hose of the rod side";
    hose_modulus: "hoses" "wall_modulus_mpa" ["MPa" = 1e6] 1.0..=1e6, "Bulk modulus of the hoses' walls";
    air_a: "trapped_air" "piston_side_l" ["L" = LITRE] 0.0..=1e3 or 0.0, "Air shut in on the piston side, at atmospheric pressure";
    air_b: "trapped_air" "rod_side_l" ["L" = LITRE] 0.0..=1e3 or 0.0, "Air shut in on the rod side, at atmospheric pressure";
    air_exponent: "trapped_air" "polytropic_exponent" ["-" = 1.0] 1.0..=1.7 or 1.4, "Its polytropic exponent";
    air_atmosphere: "trapped_air" "atmosphere_bar" ["bar" = BAR] 0.3..=1.2 or 1.013, "Atmospheric pressure, absolute";
    supply_pressure: "supply" "pressure_bar" ["bar" = BAR] 1.0..=1000.0, "Pressure of the supply where none is measured";
    tank_pressure: "supply" "tank_bar" ["bar" = BAR] -0.9..=100.0, "Pressure of the tank line where none is measured";

    link_1_length: "link_1" "length_mm" ["mm" = MM] 10.0..=1e5, "Distance from the bearing to the joint with link 2, or to the tip";
    link_1_mass: "link_1" "mass_kg" ["kg" = 1.0] 0.1..=1e5, "Mass of link 1";
    link_1_x: "link_1" "centre_x_mm" ["mm" = MM] -1e5..=1e5, "Its centre of mass along it, from the bearing";
    link_1_y: "link_1" "centre_y_mm" ["mm" = MM] -1e4..=1e4, "Its centre of mass across it, positive upwards";
    link_1_inertia: "link_1" "inertia_kgm2" ["kg m2" = 1.0] 1e-6..=1e7, "Its moment of inertia about its centre of mass";
    link_2_length: "link_2" "length_mm" ["mm" = MM] 10.0..=1e5, "Distance from its joint with link 1 to the joint with link 3, or to the tip";
    link_2_mass: "link_2" "mass_kg" ["kg" = 1.0] 0.1..=1e5, "Mass of link 2";
    link_2_x: "link_2" "centre_x_mm" ["mm" = MM] -1e5..=1e5, "Its centre of mass along it, from its joint with link 1";
    link_2_y: "link_2" "centre_y_mm" ["mm" = MM] -1e4..=1e4, "Its centre of mass across it, positive upwards";
    link_2_inertia: "link_2" "inertia_kgm2" ["kg m2" = 1.0] 1e-6..=1e7, "Its moment of inertia about its centre of mass";
    link_2_stiffness: "link_2" "joint_stiffness_knm_per_rad" ["kN m/rad" = 1e3] 0.1..=1e7, "Stiffness of the joint that holds it to link 1";
    link_2_damping: "link_2" "joint_damping_ratio" ["-" = 1.0] 0.0..=2.0, "Damping ratio of that joint with link 2 alone on it";
    link_2_angle: "link_2" "joint_angle_deg" ["deg" = DEGREE] -180.0..=180.0, "Its angle against link 1 while the joint carries no load";
    link_3_length: "link_3" "length_mm" ["mm" = MM] 10.0..=1e5, "Distance from its joint with link 2 to the tip";
    link_3_mass: "link_3" "mass_kg" ["kg" = 1.0] 0.1..=1e5, "Mass of link 3";
    link_3_x: "link_3" "centre_x_mm" ["mm" = MM] -1e5..=1e5, "Its centre of mass along it, from its joint with link 2";
    link_3_y: "link_3" "centre_y_mm" ["mm" = MM] -1e4..=1e4, "Its centre of mass across it, positive upwards";
    link_3_inertia: "link_3" "inertia_kgm2" ["kg m2" = 1.0] 1e-6..=1e7, "Its moment of inertia about its centre of mass";
    link_3_stiffness: "link_3" "joint_stiffness_knm_per_rad" ["kN m/rad" = 1e3] 0.1..=1e7, "Stiffness of the joint that holds it to link 2";
    link_3_damping: "link_3" "joint_damping_ratio" ["-" = 1.0] 0.0..=2.0, "Damping ratio of that joint with link 3 alone on it";
    link_3_angle: "link_3" "joint_angle_deg" ["deg" = DEGREE] -180.0..=180.0, "Its angle against link 2 while the joint carries no load";

    virtual_step: "virtual" "step_us" ["us" = 1e-6] 0.0..=5000.0 or 0.0, "Step of the implicit scheme for the virtual crane; 0 takes the published scheme at controller.simulation_period_us";
    seed: "virtual" "seed" ["-" = 1.0] whole 0.0..=9e15 or 0.0, "Seed of all that is drawn: noise, and the sensors' constant errors";

    supervision_pressure: "supervision" "pressure_bar" ["bar" = BAR] 1.0..=1000.0 or 200.0, "Largest pressure before the machine is stopped";
    supervision_stop: "supervision" "stop_s" ["s" = 1.0] 0.05..=5.0 or 0.4, "Duration of a controlled stop, stop category 1, from full speed";
    supervision_watchdog: "supervision" "watchdog_ms" ["ms" = MS] 1.0..=1000.0 or 20.0, "Time without a command after which the drive stops by itself";
    supervision_end_margin: "supervision" "end_margin_mm" ["mm" = MM] 0.0..=1000.0 or 10.0, "Distance from the end stops that a moving piston keeps";
    supervision_creep: "supervision" "creep_mm" ["mm" = MM] 0.1..=100.0 or 3.0, "Largest movement of a held load";
    proving_motion: "supervision" "proving_motion_mm" ["mm" = MM] 0.05..=5.0 or 0.2, "Piston motion by which the release is proven";
    supervision_tracking: "supervision" "tracking_mm" ["mm" = MM] 0.1..=1000.0 or 30.0, "Largest tracking error with feedback";
    supervision_tracking_open_loop: "supervision" "tracking_open_loop_mm" ["mm" = MM] 0.1..=1000.0 or 100.0, "Largest tracking error without feedback";
    supervision_wait: "supervision" "wait_s" ["s" = 1.0] 0.5..=3600.0 or 10.0, "Time for which a state waits for what it needs before it gives up";
    supervision_spring: "supervision" "spring_mm" ["mm" = MM] 0.1..=1000.0 or 20.0, "Largest movement of the load when pressure shut in on its unloaded side is released";
    supervision_stuck: "supervision" "stuck_ms" ["ms" = MS] 0.0..=10000.0 or 250.0, "Time after which a noisy signal that repeats itself to the last bit is stuck; 0 does not watch for it";
    supervision_position_scatter: "supervision" "position_scatter_mm" ["mm" = MM] 0.001..=100.0 or 0.2, "Largest scatter of the position from one reading to the next, RMS of 64";
    supervision_pressure_scatter: "supervision" "pressure_scatter_bar" ["bar" = BAR] 0.01..=100.0 or 3.0, "Largest scatter of a pressure from one reading to the next, RMS of 64";
    supervision_pressure_step: "supervision" "pressure_step_bar" ["bar" = BAR] 0.1..=1000.0 or 10.0, "Largest step of a pressure from one reading to the next";
    release_time: "supervision" "release_s" ["s" = 1.0] 1.0..=600.0 or 30.0, "Largest duration of a release";
}
}

/// One key that is neither a number with a unit nor a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OtherKey {
    /// `section.name`.
    pub path: &'static str,
    /// Allowed values, in words.
    pub allowed: &'static str,
    /// What applies if a file leaves the key out; `None` for a required key.
    pub absent: Option<&'static str>,
    /// Meaning.
    pub meaning: &'static str,
}

/// Every key that is neither a number with a unit nor a choice.
pub const OTHER_KEYS: [OtherKey; 4] = [
    OtherKey { path: "crane.name", allowed: "text", absent: None, meaning: "Name of the machine" },
    OtherKey {
        path: "boom.segments",
        allowed: "whole number",
        absent: Some("number of lengths in `boom.segment_lengths_mm`"),
        meaning: "Number of equal segments of a beam, 1 to 50 (3: real-time model, 10: high-fidelity model), or of links, 1 to 3",
    },
    OtherKey {
        path: "boom.segment_lengths_mm",
        allowed: "list of lengths",
        absent: Some("equal segments"),
        meaning: "Lengths of a beam's segments, from the bearing to the tip; only their proportions count",
    },
    OtherKey {
        path: "machine.ethercat",
        allowed: "table",
        absent: Some("none"),
        meaning: "Devices on the machine's EtherCAT bus, as in [EtherCAT table](ethercat-table.md)",
    },
];
