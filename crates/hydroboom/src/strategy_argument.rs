//! Argument that selects a control strategy.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use hydroboom_control::strategy::Strategy;

/// Parser of all strategies by their names.
pub fn strategies() -> impl TypedValueParser<Value = Strategy> {
    let offered = Strategy::ALL.map(|strategy| PossibleValue::new(strategy.name()));
    // refused with its own message
    let replaced = PossibleValue::new("model-following").hide(true);
    PossibleValuesParser::new(offered.into_iter().chain([replaced]))
        .try_map(|name| name.parse::<Strategy>())
}
