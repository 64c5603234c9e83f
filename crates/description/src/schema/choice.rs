//! Choices of a crane file: keys whose values are names.

/// One key whose value is a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChoiceKey {
    /// `section.name`.
    pub path: &'static str,
    /// Name that applies if a file leaves the key out; `None` for a required key.
    pub absent: Option<&'static str>,
    /// Meaning.
    pub meaning: &'static str,
    /// Allowed names, each with its meaning.
    pub names: &'static [(&'static str, &'static str)],
}

macro_rules! choices {
    ($( $(#[doc = $meaning:literal])* $field:ident: $Name:ident = $path:literal $(or $absent:ident)? {
        $( $(#[doc = $doc:literal])* $Variant:ident = $text:literal, )+
    } )+) => {
        $(
            $(#[doc = $meaning])*
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub enum $Name { $( $(#[doc = $doc])* $Variant, )+ }

            impl $Name {
                /// Path of the key, `section.name`.
                pub const PATH: &'static str = $path;
                /// Allowed names in a file.
                pub const ALLOWED: &'static [&'static str] = &[$($text),+];

                /// Choice with this name in a file; `None` for an unknown name.
                pub fn from_name(name: &str) -> Option<Self> {
                    match name { $( $text => Some(Self::$Variant), )+ _ => None }
                }

                /// Name in a file.
                pub const fn name(self) -> &'static str {
                    match self { $( Self::$Variant => $text, )+ }
                }
            }
        )+

        /// Values of all keys that are names: circuit, structure, friction law and others.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Choices {
            $( #[doc = concat!("`", $path, "`.")] pub $field: $Name, )+
        }

        impl Choices {
            /// Path `section.name` of every choice.
            pub const PATHS: [&'static str; [$($path),+].len()] = [$($path),+];
            /// Every choice with its meaning.
            pub const KEYS: [ChoiceKey; Self::PATHS.len()] = [$( ChoiceKey {
                path: $path,
                absent: choices!(@name $Name $(, $absent)?),
                meaning: concat!($($meaning),*).trim_ascii(),
                names: &[$( ($text, concat!($($doc),*).trim_ascii()) ),+],
            } ),+];

            /// Allowed names of a choice; `None` for an unknown choice.
            pub fn allowed(path: &str) -> Option<&'static [&'static str]> {
                match path { $( $path => Some($Name::ALLOWED), )+ _ => None }
            }

            /// Path and name of every choice.
            pub fn list(&self) -> [(&'static str, &'static str); Self::PATHS.len()] {
                [$( ($path, self.$field.name()) ),+]
            }

            /// Changes one choice; false for an unknown choice or name.
            pub(crate) fn set(&mut self, path: &str, name: &str) -> bool {
                match path {
                    $( $path => match $Name::from_name(name) {
                        Some(choice) => { self.$field = choice; true }
                        None => false,
                    }, )+
                    _ => false,
                }
            }

            /// Reads the choices of a file. A required choice that is missing gets the first allowed name, and its
            /// path is returned.
            pub(crate) fn read<'a>(text: impl Fn(&str) -> Option<&'a str>) -> (Self, Vec<&'static str>) {
                let mut missing = Vec::new();
                let choices = Self { $( $field: match text($path).and_then($Name::from_name) {
                    Some(choice) => choice,
                    None => choices!(@absent missing, $Name, $path $(, $absent)?),
                } ),+ };
                (choices, missing)
            }
        }
    };
    (@absent $missing:ident, $Name:ident, $path:literal) => {{
        $missing.push($path);
        match $Name::from_name($Name::ALLOWED[0]) {
            Some(first) => first,
            None => unreachable!("every listed name has its choice"),
        }
    }};
    (@absent $missing:ident, $Name:ident, $path:literal, $absent:ident) => { $Name::$absent };
    (@name $Name:ident) => { None };
    (@name $Name:ident, $absent:ident) => { Some($Name::$absent.name()) };
}

choices! {
    /// Actuation of the cylinder.
    circuit: CircuitChoice = "circuit.type" or SelfContained {
        /// Own pump (electro-hydraulic actuator): the published circuit.
        SelfContained = "self-contained",
        /// 4/3 valve with a supply of constant pressure.
        ValveControlled = "valve-controlled",
    }
    /// Model of the boom.
    structure: StructureChoice = "boom.structure" or Beam {
        /// A uniform beam, divided into segments: the published boom.
        Beam = "beam",
        /// Links, each with its own cross section.
        Links = "links",
    }
    /// Friction law of the cylinder.
    friction: FrictionChoice = "friction.law" {
        /// Published law (Stribeck curve).
        Stribeck = "stribeck",
        /// LuGre law, with friction at standstill.
        LuGre = "lugre",
    }
    /// Computation of the pump's flow gain k_flow.
    delivery: DeliveryChoice = "pump.delivery" {
        /// The constant `pump.flow_gain`.
        Published = "published",
        /// Computed from the pressures at every step.
        Computed = "computed",
    }
    /// The shape of the motion's ramps.
    profile: ProfileChoice = "motion.profile" {
        /// Linear ramps, as published.
        Trapezoidal = "trapezoidal",
        /// Jerk-limited ramps.
        SCurve = "s-curve",
    }
    /// Whether relief valves 13 are modelled.
    relief: ReliefChoice = "relief.valves" {
        /// None, as published.
        None = "none",
        /// One at each pump side.
        Fitted = "fitted",
    }
    /// Whether load-holding valve 3, while closed, passes oil from the pump to the cylinder.
    holding_check: HoldingCheckChoice = "holding_valve.check_function" or Check {
        /// Pilot-operated check valve, as published: it does.
        Check = "check",
        /// Valve that blocks both directions.
        None = "none",
    }
    /// Whether the 3/2 switching valve has a position switch.
    position_switch: PositionSwitchChoice = "switching_valve.position_switch" or None {
        /// No position switch.
        None = "none",
        /// Position switch fitted.
        Fitted = "fitted",
    }
}
