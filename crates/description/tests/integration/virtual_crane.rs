//! The virtual crane of a crane file.

use hydroboom_description::{Description, UIA_SINGLE_BOOM, by_weight};

/// Keys in which two descriptions differ.
fn keys(a: &Description, b: &Description) -> Vec<String> {
    a.differences(b).into_iter().map(|difference| difference.key).collect()
}

#[test]
fn missing_equipment_keys_take_typical_values_only() {
    let mut model = Description::uia_single_boom().unwrap();
    model.set("payload.mass_kg=250").unwrap();
    let (machine, filled_in) = model.virtual_crane();
    assert_eq!(machine.numbers.payload, 250.0);
    let filled: Vec<String> = filled_in.iter().map(|f| f.key.path()).collect();
    assert!(
        filled.len() == 17 && filled.contains(&"sensors.position_noise_mm".to_string()),
        "{filled:?}"
    );
    // no other key differs, and each value is the machine's
    assert!(keys(&model, &machine).iter().all(|key| filled.contains(key)));
    assert!(model.differences(&machine).iter().all(|difference| difference.is_of_equipment()));
    for f in &filled_in {
        let (_, value, origin) =
            machine.entries().find(|(key, ..)| key.path() == f.key.path()).unwrap();
        assert_eq!((value, origin.provenance.as_str()), (f.value, "typical"), "{f}");
        assert!((f.key.low..=f.key.high).contains(&f.value) && !f.source.is_empty(), "{f}");
    }
    assert!(!model.has_sensor_noise() && machine.has_sensor_noise());
    // applying it again changes nothing
    assert!(machine.virtual_crane().1.is_empty());
    assert_eq!(machine.virtual_crane().0.digest(), machine.digest());
    // removing the equipment restores the model
    assert_eq!(machine.without_equipment().digest(), model.digest());
}

#[test]
fn stated_values_are_not_replaced_by_typical_ones() {
    let text =
        format!("{UIA_SINGLE_BOOM}\n[drive]\nbandwidth_hz = 0\n[fieldbus]\ndelay_cycles = 3\n");
    let mut model = Description::parse("test.toml", &text).unwrap();
    model.set("sensors.position_noise_mm=0").unwrap();
    let (machine, filled_in) = model.virtual_crane();
    assert_eq!(machine.numbers.drive_bandwidth, 0.0);
    assert_eq!(machine.numbers.fieldbus_delay, 3.0);
    assert_eq!(machine.numbers.position_noise, 0.0);
    assert_eq!(filled_in.len(), 14);
    assert!(!machine.has_sensor_noise());
}

#[test]
fn the_drive_and_the_transducers_suit_the_crane() {
    let crane = |overrides: &[&str]| {
        let mut crane = Description::uia_single_boom().unwrap();
        overrides.iter().for_each(|assignment| crane.set(assignment).unwrap());
        crane.virtual_crane().0.numbers
    };
    let (usual, small) = (crane(&[]), crane(&["pump.displacement_cm3=5.3", "payload.mass_kg=150"]));
    // the drive can lift the payload of the file, with reserve
    assert!((25.0..40.0).contains(&usual.drive_torque), "{}", usual.drive_torque);
    assert!(small.drive_torque < 0.5 * usual.drive_torque, "{}", small.drive_torque);
    assert!(small.drive_inertia < 0.5 * usual.drive_inertia);
    let bar = |n: &hydroboom_description::Numbers<f64>| (n.pressure_span * 1e-5).round();
    assert_eq!(bar(&usual), 250.0);
    assert_eq!(bar(&crane(&["supervision.pressure_bar=300"])), 400.0);
    let torque = crane(&["drive.max_torque_nm=64"]);
    assert!((torque.drive_inertia / 0.009 - 1.0).abs() < 1e-9, "{}", torque.drive_inertia);
}

#[test]
fn a_valve_controlled_crane_is_left_unchanged() {
    let lift = Description::patu_lift().unwrap();
    let (machine, filled_in) = lift.virtual_crane();
    assert!(filled_in.is_empty() && machine.digest() == lift.digest());
    assert_eq!(lift.equipment_text(), "");
}

#[test]
fn the_text_of_typical_equipment_completes_a_file() {
    let model = Description::uia_single_boom().unwrap();
    let text = format!("{UIA_SINGLE_BOOM}{}", model.equipment_text());
    let complete = Description::parse("test.toml", &text).unwrap();
    let (machine, filled_in) = complete.virtual_crane();
    let left: Vec<String> = filled_in.iter().map(|f| f.key.path()).collect();
    assert_eq!(left, ["virtual.step_us", "virtual.seed"]);
    assert_eq!(machine.digest(), model.virtual_crane().0.digest());
}

#[test]
fn differences_are_sorted_by_their_effect() {
    let model = Description::uia_single_boom().unwrap();
    let mut machine = model.virtual_crane().0;
    machine.set("friction.law=lugre").unwrap();
    machine.set("payload.mass_kg=310").unwrap();
    machine.set("friction.coulomb_n=800").unwrap();
    machine.set("controller.high_pass_s=9").unwrap();
    let sorted = by_weight(model.differences(&machine));
    let keys: Vec<&str> = sorted.iter().map(|difference| difference.key.as_str()).collect();
    assert_eq!(keys[..3], ["friction.law", "friction.coulomb_n", "payload.mass_kg"]);
    let (last, between) = sorted[3..].split_last().unwrap();
    assert!(between.iter().all(|difference| difference.is_of_equipment()), "{keys:?}");
    assert_eq!(last.key, "controller.high_pass_s");
}
