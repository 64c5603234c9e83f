//! TwinCAT 3: a file for each unit, to be added to a PLC project as an existing item.

use super::unit::{Form, Kind, Unit};

/// Name and text of the TwinCAT 3 file of a unit.
pub fn file(unit: &Unit) -> (String, String) {
    let data = |text: &str| format!("<![CDATA[{}]]>", text.replace("]]>", "]] >"));
    let id = identity(&unit.name);
    let name = &unit.name;
    let declaration = data(&unit.declaration(Form::TwinCat));
    let head = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<TcPlcObject Version=\"1.1.0.1\" ProductVersion=\"3.1.4024.0\">\n";
    match unit.kind {
        Kind::Globals => (
            format!("{name}.TcGVL"),
            format!(
                "{head}  <GVL Name=\"{name}\" Id=\"{id}\">\n    <Declaration>{declaration}</Declaration>\n  </GVL>\n</TcPlcObject>\n"
            ),
        ),
        Kind::Function | Kind::FunctionBlock | Kind::Program => (
            format!("{name}.TcPOU"),
            format!(
                "{head}  <POU Name=\"{name}\" Id=\"{id}\" SpecialFunc=\"None\">\n    <Declaration>{declaration}</Declaration>\n    \
                 <Implementation>\n      <ST>{}</ST>\n    </Implementation>\n  </POU>\n</TcPlcObject>\n",
                data(&unit.statements(Form::TwinCat))
            ),
        ),
    }
}

/// A GUID that is reproducible for the same unit.
fn identity(name: &str) -> String {
    // FNV-1a twice with different offsets: the GUID only distinguishes units
    let hash = |begin: u64| {
        name.bytes().fold(begin, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
    };
    let (a, b) = (hash(0xcbf2_9ce4_8422_2325), hash(0x8422_2325_cbf2_9ce4));
    format!(
        "{{{:08x}-{:04x}-{:04x}-{:04x}-{:012x}}}",
        a >> 32,
        (a >> 16) & 0xffff,
        (a & 0x0fff) | 0x4000,
        (b >> 48 & 0x3fff) | 0x8000,
        b & 0xffff_ffff_ffff
    )
}
