//! Link: carries Ethernet frames to the devices and back.

/// A network interface, or devices that are simulated.
pub trait Link {
    /// Sends a whole Ethernet frame; false where it could not be sent.
    fn send(&mut self, frame: &[u8]) -> bool;

    /// Waits for a frame until a time \[ns\] of [`now`](crate::time::now). Returns its length; none where no frame
    /// came.
    fn receive(&mut self, frame: &mut [u8], until: u64) -> Option<usize>;

    /// Waits until a time \[ns\].
    fn wait(&mut self, until: u64);
}
