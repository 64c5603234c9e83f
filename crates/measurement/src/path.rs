//! Headings of numbers within structures and messages: `cylinder.pressure_a_bar[2]`.

use crate::heading::Heading;
use crate::unit::Unit;

/// Name and unit of a path. The unit is stated in its last part, before an index; enclosing parts state none.
pub(crate) fn heading(path: &str) -> Heading {
    let last = path.rfind('.').map_or(0, |dot| dot + 1);
    let (before, last) = path.split_at(last);
    let (field, index) = last.split_at(last.find('[').unwrap_or(last.len()));
    // `p [bar]` and `p[bar]` state a unit, `p[2]` and `position[boom]` an index
    let inside = index.strip_prefix('[').and_then(|i| i.strip_suffix(']'));
    let is_unit = |inside: &str| field.ends_with(' ') || Unit::find(inside).is_some();
    let is_index = inside.is_some_and(|i| i.parse::<usize>().is_ok() || !is_unit(i));
    let (field, index) = if is_index && !field.is_empty() { (field, index) } else { (last, "") };
    let read = Heading::parse(field);
    Heading { name: format!("{before}{}{index}", read.name), ..read }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_taken_from_the_last_part_of_a_path() {
        for (path, name, unit) in [
            ("stroke_mm", "stroke", Some("mm")),
            ("/cyl1.pressure_a", "/cyl1.pressure_a", None),
            ("cyl_bar.pressure_a_bar", "cyl_bar.pressure_a", Some("bar")),
            ("joints.position[boom]", "joints.position[boom]", None),
            ("pressures_bar[2]", "pressures[2]", Some("bar")),
            ("cyl.p_A [bar]", "cyl.p_A", Some("bar")),
            ("cyl.p_A[bar]", "cyl.p_A", Some("bar")),
        ] {
            let read = heading(path);
            assert_eq!((read.name.as_str(), read.unit.map(|u| u.name)), (name, unit), "{path}");
            assert_eq!(read.unknown_unit, None, "{path}");
        }
    }
}
