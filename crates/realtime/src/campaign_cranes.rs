//! Cranes of the fault-injection campaign: the paper's crane, and cranes with another payload, lever or
//! bore.

use hydroboom_description::{Description, DescriptionError};

/// Crane of the fault-injection campaign: the controller's model, and the virtual crane as the machine.
#[derive(Clone, Debug)]
pub struct CampaignCrane {
    /// Name in tables.
    pub name: &'static str,
    /// Description from which controller and supervision limits are designed.
    pub model: Description,
    /// Virtual crane that takes the place of the machine.
    pub machine: Description,
}

/// Overrides of the paper's crane, as in a `[set]` table.
const OTHERS: [(&str, &str); 3] = [
    ("half the mass", include_str!("../../../cranes/half-mass.toml")),
    ("twice the mass", include_str!("../../../cranes/double-mass.toml")),
    ("another lever and bore", include_str!("../../../cranes/other-lever.toml")),
];

/// Cranes of the campaign, the paper's crane first.
///
/// # Errors
///
/// [`DescriptionError`] if an override is invalid. A test proves that none is.
pub fn campaign_cranes() -> Result<Vec<CampaignCrane>, DescriptionError> {
    let (model, machine) = (Description::uia_single_boom()?, Description::uia_virtual()?);
    let mut cranes =
        vec![CampaignCrane { name: "the paper's", model: model.clone(), machine: machine.clone() }];
    for (name, set) in OTHERS {
        let model = model.overridden(name, set)?.0;
        let machine = machine.overridden(name, set)?.0;
        cranes.push(CampaignCrane { name, model, machine });
    }
    Ok(cranes)
}

/// Crane whose load-holding valve has the slowest switching time of its range, or the fastest if `slowest` is false.
/// The machine takes delay and pilot line from the ranges of the crane file; the controller's model is unchanged.
pub fn at_valve_end(crane: &CampaignCrane, slowest: bool) -> CampaignCrane {
    let mut changed = crane.clone();
    let ranges = crane.machine.ranges();
    let end = if slowest { &ranges.high } else { &ranges.low };
    let n = &mut changed.machine.numbers;
    (n.valve_delay, n.pilot_line) = (end.valve_delay, end.pilot_line);
    changed
}
