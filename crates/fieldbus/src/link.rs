//! Link: carries Ethernet frames to the devices and back (IEC 61158-4-12, EtherType 0x88A4).

/// A network interface, or devices that are simulated. All times are those of [`now`](crate::time::now) \[ns\].
pub trait Link {
    /// Sends a whole Ethernet frame, without its check sequence and without waiting; false where it could not be sent.
    fn send(&mut self, frame: &[u8]) -> bool;

    /// Waits for a frame until a time \[ns\], which may have passed. Returns its length \[byte\]; none where no frame
    /// came. A frame that is longer than `frame` is truncated or lost.
    fn receive(&mut self, frame: &mut [u8], until: u64) -> Option<usize>;

    /// Waits until a time \[ns\]; returns at once where it has passed.
    fn wait(&mut self, until: u64);
}
