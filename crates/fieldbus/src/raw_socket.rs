//! Raw socket: a network interface as a link, by Linux's AF_PACKET sockets.
//!
//! A waiting task sleeps in the kernel: with a real-time priority, polling would keep the interface's interrupt, or a
//! simulation of devices, from running on its core.

use crate::interface::{InterfaceError, check};
use crate::link::Link;
use crate::time::now;
use hydroboom_realtime::posix::{wait_for_input, wait_until};
use nix::errno::Errno;
use nix::sys::socket::{MsgFlags, bind, recv, send};
use socket2::{Domain, Protocol, Socket, Type};
use std::io;
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};

/// EtherType of EtherCAT (IEC 61158-4-12).
pub const ETHERTYPE: u16 = 0x88a4;
/// Time for which an interface has to be silent \[ns\]: longer than the longest period of a bus.
const SILENCE: u64 = 20_000_000;
/// Largest Ethernet frame \[byte\].
const LARGEST_FRAME: usize = 1536;

/// A network interface that is reserved for this bus, as a [`Link`].
#[derive(Debug)]
pub struct RawSocket {
    /// Packet socket that receives frames of EtherCAT only.
    socket: Socket,
    /// Keeps other processes of this program away from the interface, until it is dropped or the process ends.
    _lock: UnixListener,
}

impl RawSocket {
    /// Opens an interface for a main device. It is refused where another process has it, or where frames already
    /// arrive within 20 ms.
    ///
    /// # Errors
    ///
    /// [`InterfaceError::HasTraffic`] where frames arrive; else as of [`open_for_devices`](Self::open_for_devices).
    pub fn open(interface: &str) -> Result<Self, InterfaceError> {
        let mut raw = Self::open_for_devices(interface)?;
        let mut frame = [0; LARGEST_FRAME];
        match raw.receive(&mut frame, now() + SILENCE) {
            Some(_) => Err(InterfaceError::HasTraffic(interface.into())),
            None => Ok(raw),
        }
    }

    /// Opens an interface for simulated devices, which only answer frames: traffic is no reason to refuse it.
    ///
    /// # Errors
    ///
    /// - [`InterfaceError::NoPermission`] where the process may not open a raw socket.
    /// - [`InterfaceError::InUse`] where another process of this program has the interface.
    /// - [`InterfaceError::System`] for another error of the system.
    /// - The other variants, but `HasTraffic`, where the interface cannot carry the frames of a bus.
    pub fn open_for_devices(interface: &str) -> Result<Self, InterfaceError> {
        let link = check(interface)?;
        let of = |error: io::Error| match error.kind() {
            io::ErrorKind::PermissionDenied => InterfaceError::NoPermission(interface.into()),
            _ => InterfaceError::System(interface.into(), error),
        };
        let socket = socket(&link).map_err(of)?;
        // an abstract socket name in the network namespace, which the kernel frees when its process ends
        let name = SocketAddr::from_abstract_name(format!("hydroboom-ethercat-{interface}"));
        let lock = name.and_then(|name| UnixListener::bind_addr(&name));
        let lock = lock.map_err(|error| match error.kind() {
            io::ErrorKind::AddrInUse => InterfaceError::InUse(interface.into()),
            _ => of(error),
        })?;
        Ok(Self { socket, _lock: lock })
    }
}

/// A socket for frames of EtherCAT at an interface.
fn socket(link: &nix::sys::socket::LinkAddr) -> io::Result<Socket> {
    let protocol = Protocol::from(i32::from(ETHERTYPE.to_be()));
    let socket = Socket::new(Domain::PACKET, Type::RAW, Some(protocol))?;
    // the address of the interface has no protocol, so that the socket keeps its own
    bind(socket.as_raw_fd(), link)?;
    // discards frames of other interfaces that came before the socket was bound
    let mut frame = [0; LARGEST_FRAME];
    while recv(socket.as_raw_fd(), &mut frame, MsgFlags::MSG_DONTWAIT).is_ok() {}
    Ok(socket)
}

impl Link for RawSocket {
    fn send(&mut self, frame: &[u8]) -> bool {
        send(self.socket.as_raw_fd(), frame, MsgFlags::MSG_DONTWAIT) == Ok(frame.len())
    }

    fn receive(&mut self, frame: &mut [u8], until: u64) -> Option<usize> {
        loop {
            match recv(self.socket.as_raw_fd(), frame, MsgFlags::MSG_DONTWAIT) {
                Ok(length) => return Some(length),
                Err(Errno::EAGAIN | Errno::EINTR) => {
                    let remaining = until.saturating_sub(now());
                    if remaining == 0 {
                        return None;
                    }
                    wait_for_input(&self.socket, remaining);
                }
                // the interface is gone or switched off: frames are lost until it is back
                Err(_) => {
                    self.wait(until);
                    return None;
                }
            }
        }
    }

    fn wait(&mut self, until: u64) {
        wait_until(until, 0);
    }
}
