//! Records of physical quantities: named fields, one number each, with their units.

/// Declares a record whose fields are all of the same number type.
///
/// Besides the struct it generates the tables for logs, exports and dashboards (`NAMES`, `UNITS`, `MEANINGS`) and the
/// conversions for an integrator (`from_array`, `to_array`, `map`).
///
/// ```
/// hydroboom_math::record! {
///     /// A point of the crane's plane.
///     pub struct Point<T> {
///         /// Distance to the right of the boom's bearing
///         #[unit = "m"]
///         pub x: T,
///         /// Height above the boom's bearing
///         #[unit = "m"]
///         pub y: T,
///     }
/// }
/// assert_eq!(Point::NAMES, ["x", "y"]);
/// assert_eq!(Point { x: 1.0, y: 2.0 }.map(|v| 2.0 * v).to_array(), [2.0, 4.0]);
/// ```
#[macro_export]
macro_rules! record {
    (
        $(#[$meta:meta])*
        pub struct $Name:ident<T> {
            $( $(#[doc = $doc:literal])* #[unit = $unit:literal] pub $field:ident: T, )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct $Name<T> {
            $( $(#[doc = $doc])* #[doc = concat!(" \\[", $unit, "\\]")] pub $field: T, )+
        }

        // On one instance only, so that `NAMES` needs no type argument where it is used.
        impl $Name<()> {
            /// Field names, in declaration order.
            pub const NAMES: [&'static str; [$($unit),+].len()] = [$(stringify!($field)),+];
            /// Units, in declaration order.
            pub const UNITS: [&'static str; [$($unit),+].len()] = [$($unit),+];
            /// Meanings of the fields, in declaration order: their documentation.
            pub const MEANINGS: [&'static str; [$($unit),+].len()] = [$(concat!($($doc),*)),+];
        }

        impl<T> $Name<T> {
            /// The record with the given fields, in declaration order.
            #[inline(always)]
            pub fn from_array([$($field),+]: [T; $Name::NAMES.len()]) -> Self {
                Self { $($field),+ }
            }

            /// The fields, in declaration order.
            #[inline(always)]
            pub fn to_array(self) -> [T; $Name::NAMES.len()] {
                [$(self.$field),+]
            }

            /// The same record in another number type.
            #[inline(always)]
            pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> $Name<U> {
                $Name { $($field: f(self.$field)),+ }
            }
        }
    };
}
