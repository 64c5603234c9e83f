//! Argument that selects the machine of `run`.

use crate::paths::InputFile;
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::ffi::OsString;
use std::path::Path;

/// Machine that `run` controls.
#[derive(Clone, Debug)]
pub enum MachineArgument {
    /// Virtual crane in a process of its own: of the crane file, or of a file.
    Virtual(Option<InputFile>),
    /// Machine in another process on the local interface, at this UDP port.
    Udp(u16),
    /// Devices for EtherCAT at this network interface.
    EtherCat(String),
}

impl MachineArgument {
    /// Parser for `virtual`, `virtual:FILE`, `udp:PORT`, `ethercat:INTERFACE`, or a file.
    pub fn parser() -> impl TypedValueParser<Value = Self> {
        OsStringValueParser::new().try_map(Self::parse)
    }

    /// Parses the argument; a text of no known kind is a file.
    fn parse(given: OsString) -> Result<Self, String> {
        let Some(text) = given.to_str() else { return Ok(Self::Virtual(Some(given.into()))) };
        match text.split_once(':') {
            None if text == "virtual" => Ok(Self::Virtual(None)),
            Some(("virtual", "")) => {
                Err("no file after virtual: - it is virtual, or virtual:FILE".into())
            }
            Some(("virtual", file)) => Ok(Self::Virtual(Some(OsString::from(file).into()))),
            Some(("udp", port)) => match port.parse::<u16>() {
                Ok(port) if port > 0 => Ok(Self::Udp(port)),
                _ => Err(format!(
                    "\"{port}\" is no UDP port: it is a number from 1 to 65535, as in udp:8150"
                )),
            },
            Some(("ethercat", "")) => {
                Err("no network interface after ethercat: - it is ethercat:INTERFACE, as in ethercat:eth1".into())
            }
            Some(("ethercat", interface)) => Ok(Self::EtherCat(interface.into())),
            _ => Ok(Self::Virtual(Some(given.into()))),
        }
    }

    /// Crane file of a virtual crane, if one is named.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Virtual(file) => file.as_deref(),
            Self::Udp(_) | Self::EtherCat(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_is_named_by_its_kind_or_its_file() {
        let parse = |text: &str| MachineArgument::parse(text.into());
        for (text, file) in [
            ("virtual", None),
            ("virtual:a.toml", Some("a.toml")),
            ("a.toml", Some("a.toml")),
            ("./udp:7", Some("./udp:7")),
        ] {
            assert_eq!(parse(text).unwrap().file(), file.map(Path::new), "{text}");
        }
        assert!(matches!(parse("udp:8150"), Ok(MachineArgument::Udp(8150))));
        let bus = parse("ethercat:enp3s0");
        assert!(matches!(bus, Ok(MachineArgument::EtherCat(interface)) if interface == "enp3s0"));
        for wrong in ["udp:", "udp:0", "udp:65536", "udp:-1", "udp:x", "virtual:", "ethercat:"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
