//! Network interface: whether it can carry frames for EtherCAT, and what to do where it cannot.
//!
//! Frames of a bus are broadcast every period. On an interface of a network, these frames and the network's traffic
//! disturb each other: so an interface with an address, with the default route, or in a bridge is refused.

use nix::ifaddrs::{InterfaceAddress, getifaddrs};
use nix::net::if_::InterfaceFlags;
use nix::sys::socket::{LinkAddr, SockaddrStorage};
use std::fmt::{self, Display, Formatter};
use std::fs;
use std::io;
use std::net::IpAddr;
use std::path::{Path, PathBuf};

/// Why an interface is refused. Its text says what to do.
#[derive(Debug)]
pub enum InterfaceError {
    /// There is none of this name; those that there are.
    Unknown(String, Vec<String>),
    /// It is this computer's own loopback.
    Loopback(String),
    /// It is wireless.
    Wireless(String),
    /// It is a bridge.
    Bridge(String),
    /// It belongs to a bridge or a bond.
    Member(String),
    /// It has an address.
    HasAddress(String, IpAddr),
    /// It has the default route.
    HasDefaultRoute(String),
    /// It is switched off.
    Down(String),
    /// It has no link: no cable, or no device at its other end.
    NoCarrier(String),
    /// The process may not send frames.
    NoPermission(String),
    /// Another process of this program uses it.
    InUse(String),
    /// It carries frames for EtherCAT already, of another main device.
    HasTraffic(String),
    /// Another error of the system.
    System(String, io::Error),
}

impl Display for InterfaceError {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(name, others) => write!(
                f,
                "there is no network interface {name}; there are {}",
                if others.is_empty() { "none".into() } else { others.join(", ") }
            ),
            Self::Loopback(name) => write!(
                f,
                "{name} is this computer's loopback: name the network interface that the first device is plugged into"
            ),
            Self::Wireless(name) => write!(
                f,
                "{name} is wireless: EtherCAT needs a cable from a network interface of this computer to the first \
                 device"
            ),
            Self::Bridge(name) => write!(
                f,
                "{name} is a bridge, which delays frames and forwards them elsewhere: name the network interface \
                 itself, and take it out of the bridge"
            ),
            Self::Member(name) => write!(
                f,
                "{name} belongs to a bridge or a bond, which would take its frames: take it out (ip link set {name} \
                 nomaster)"
            ),
            Self::HasAddress(name, address) => write!(
                f,
                "{name} has the address {address}, so that it is in use for a network: name one that is reserved \
                 for the bus, or remove its addresses (ip addr flush dev {name}; sysctl -w \
                 net.ipv6.conf.{name}.disable_ipv6=1)"
            ),
            Self::HasDefaultRoute(name) => write!(
                f,
                "{name} has the default route, so that it is this computer's way to its network: name one that is \
                 reserved for the bus"
            ),
            Self::Down(name) => {
                write!(f, "{name} is switched off: switch it on (ip link set {name} up)")
            }
            Self::NoCarrier(name) => {
                write!(f, "{name} has no link: check the cable to the first device and its supply")
            }
            Self::NoPermission(name) => write!(
                f,
                "this program may not send frames on {name} (CAP_NET_RAW): allow it with sudo setcap \
                 cap_net_raw,cap_sys_nice,cap_ipc_lock+ep FILE, FILE being the program, {}",
                std::env::current_exe()
                    .map_or_else(|_| "hydroboom".into(), |p| p.display().to_string())
            ),
            Self::InUse(name) => write!(
                f,
                "another process uses {name}, perhaps another hydroboom run: end that first"
            ),
            Self::HasTraffic(name) => write!(
                f,
                "{name} carries frames for EtherCAT already: end the other main device there, or unplug a second \
                 cable from the bus to this computer"
            ),
            Self::System(name, error) => write!(f, "{name} cannot be used: {error}"),
        }
    }
}

impl std::error::Error for InterfaceError {}

/// An interface that may carry frames: its address for a socket.
///
/// # Errors
///
/// [`InterfaceError`], which says what to do.
pub(crate) fn check(name: &str) -> Result<LinkAddr, InterfaceError> {
    let of = |error: io::Error| InterfaceError::System(name.into(), error);
    let all: Vec<InterfaceAddress> = getifaddrs().map_err(|error| of(error.into()))?.collect();
    let link = all.iter().filter(|entry| entry.interface_name == name).find_map(link_address);
    let Some((link, flags)) = link else {
        let mut others: Vec<String> = all
            .iter()
            .filter(|entry| link_address(entry).is_some())
            .map(|entry| entry.interface_name.clone())
            .collect();
        others.sort();
        return Err(InterfaceError::Unknown(name.into(), others));
    };
    if flags.contains(InterfaceFlags::IFF_LOOPBACK) {
        return Err(InterfaceError::Loopback(name.into()));
    }
    let directory = sysfs_directory(name, link.ifindex());
    let has = |what: &str| directory.as_ref().is_some_and(|folder| folder.join(what).exists());
    if has("phy80211") || has("wireless") || is_listed("/proc/net/wireless", name) {
        return Err(InterfaceError::Wireless(name.into()));
    }
    if has("bridge") {
        return Err(InterfaceError::Bridge(name.into()));
    }
    if has("master") || flags.contains(InterfaceFlags::IFF_SLAVE) {
        return Err(InterfaceError::Member(name.into()));
    }
    if has_default_route(&read("/proc/net/route"), &read("/proc/net/ipv6_route"), name) {
        return Err(InterfaceError::HasDefaultRoute(name.into()));
    }
    let addresses = all.iter().filter(|entry| entry.interface_name == name);
    if let Some(address) = addresses.filter_map(|entry| entry.address.as_ref()).find_map(ip_address)
    {
        return Err(InterfaceError::HasAddress(name.into(), address));
    }
    if !flags.contains(InterfaceFlags::IFF_UP) {
        return Err(InterfaceError::Down(name.into()));
    }
    if !flags.contains(InterfaceFlags::IFF_RUNNING) {
        return Err(InterfaceError::NoCarrier(name.into()));
    }
    Ok(link)
}

/// Link-layer address and flags, if the entry has them.
fn link_address(entry: &InterfaceAddress) -> Option<(LinkAddr, InterfaceFlags)> {
    let link = entry.address.as_ref()?.as_link_addr()?;
    Some((*link, entry.flags))
}

/// IPv4 or IPv6 address, if the entry has one.
fn ip_address(address: &SockaddrStorage) -> Option<IpAddr> {
    let four = address.as_sockaddr_in().map(|four| IpAddr::V4(four.ip()));
    four.or_else(|| address.as_sockaddr_in6().map(|six| IpAddr::V6(six.ip())))
}

/// The system's folder of an interface; none where it shows those of another network namespace.
pub(crate) fn sysfs_directory(name: &str, index: usize) -> Option<PathBuf> {
    let folder = Path::new("/sys/class/net").join(name);
    let listed = fs::read_to_string(folder.join("ifindex")).ok()?;
    (listed.trim().parse() == Ok(index)).then_some(folder)
}

/// Text of a file of the system; empty where it cannot be read.
fn read(file: &str) -> String {
    fs::read_to_string(file).unwrap_or_default()
}

/// Whether a file of lines `name: ...` has an interface.
fn is_listed(file: &str, name: &str) -> bool {
    read(file)
        .lines()
        .any(|line| line.trim().strip_prefix(name).is_some_and(|rest| rest.starts_with(':')))
}

/// Whether the kernel's IPv4 or IPv6 routing table has its default route at an interface.
fn has_default_route(four: &str, six: &str, name: &str) -> bool {
    let words = |line: &str| -> Vec<String> { line.split_whitespace().map(String::from).collect() };
    // interface, destination, ..., mask
    let by_four = four.lines().map(words).any(|line| {
        line.first().is_some_and(|first| first == name)
            && line.get(1).is_some_and(|to| to == "00000000")
            && line.get(7).is_some_and(|mask| mask == "00000000")
    });
    // destination, its length, ..., interface
    let by_six = six.lines().map(words).any(|line| {
        line.last().is_some_and(|last| last == name)
            && line.first().is_some_and(|to| to.bytes().all(|digit| digit == b'0'))
            && line.get(1).is_some_and(|length| length == "00")
    });
    by_four || by_six
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_default_route_of_the_kernels_tables_is_found() {
        let four = "Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT\n\
                    eth0\t00000000\t010011AC\t0003\t0\t0\t0\t00000000\t0\t0\t0\n\
                    eth1\t000011AC\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n";
        let zero = "0".repeat(32);
        let six = format!(
            "{zero} 00 {zero} 00 fe800000000000000000000000000001 00000400 00000001 00000000 00000003     eth2\n\
             fe80{} 40 {zero} 00 {zero} 00000100 00000001 00000000 00000001     eth3\n",
            "0".repeat(28)
        );
        let found =
            ["eth0", "eth1", "eth2", "eth3", "eth"].map(|name| has_default_route(four, &six, name));
        assert_eq!(found, [true, false, true, false, false]);
    }

    #[test]
    fn an_unsuitable_interface_is_refused_with_a_remedy() {
        let refused = |name: &str| check(name).expect_err("it is refused").to_string();
        let unknown = refused("nowhere0");
        assert!(unknown.contains("nowhere0") && unknown.contains("lo"), "{unknown}");
        assert!(refused("lo").contains("loopback"));
    }
}
