//! MDF files block by block, for what asammdf does not write.

/// A file that grows by blocks; those that are linked to come first.
pub struct File {
    pub bytes: Vec<u8>,
}

/// Where the header stands, and how long it is.
const HEADER: usize = 64;
const HEADER_SIZE: usize = 24 + 6 * 8 + 32;

impl File {
    /// A file that begins in a way, `MDF     ` or `UnFinMF `.
    pub fn new(begins: &str, version: &str) -> Self {
        let mut bytes = format!("{begins}{version:8}hand    ").into_bytes();
        bytes.resize(HEADER + HEADER_SIZE, 0);
        Self { bytes }
    }

    /// Adds a block; where it stands.
    pub fn block(&mut self, id: &str, links: &[u64], data: &[u8]) -> u64 {
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        let at = self.bytes.len() as u64;
        self.bytes.extend(block(id, links, data));
        at
    }

    /// Adds a text.
    pub fn text(&mut self, text: &str) -> u64 {
        self.block("##TX", &[], format!("{text}\0").as_bytes())
    }

    /// Adds a channel: kind (0 a number, 1 of varying length, 2 the time), type of numbers, first byte, bits.
    pub fn channel(&mut self, next: u64, name: &str, unit: &str, layout: [u32; 4]) -> u64 {
        let (name, unit) = (self.text(name), self.text(unit));
        let [kind, numbers, byte, bits] = layout;
        let mut data = vec![kind as u8, u8::from(kind == 2), numbers as u8, 0];
        data.extend(byte.to_le_bytes());
        data.extend(bits.to_le_bytes());
        data.resize(72, 0);
        self.block("##CN", &[next, 0, name, 0, 0, 0, unit, 0], &data)
    }

    /// Adds a group: number, records, bytes of one, and whether it holds texts of varying length.
    pub fn group(&mut self, next: u64, channels: u64, numbers: [u64; 3], is_text: bool) -> u64 {
        let [id, cycles, size] = numbers;
        let mut data = [id.to_le_bytes(), cycles.to_le_bytes()].concat();
        data.extend(u16::from(is_text).to_le_bytes());
        data.resize(24, 0);
        data.extend((size as u32).to_le_bytes());
        data.extend([0; 4]);
        self.block("##CG", &[next, channels, 0, 0, 0, 0], &data)
    }

    /// The whole file with one data group, whose records begin with a number of `id_size` bytes.
    pub fn finish(mut self, group: u64, data: u64, id_size: u8) -> Vec<u8> {
        let first = self.block("##DG", &[0, group, data, 0], &[id_size, 0, 0, 0, 0, 0, 0, 0]);
        let header = block("##HD", &[first, 0, 0, 0, 0, 0], &[0; 32]);
        self.bytes[HEADER..HEADER + HEADER_SIZE].copy_from_slice(&header);
        self.bytes
    }
}

fn block(id: &str, links: &[u64], data: &[u8]) -> Vec<u8> {
    let size = 24 + 8 * links.len() + data.len();
    let mut bytes = id.as_bytes().to_vec();
    bytes.extend([0; 4]);
    bytes.extend((size as u64).to_le_bytes());
    bytes.extend((links.len() as u64).to_le_bytes());
    bytes.extend(links.iter().flat_map(|l| l.to_le_bytes()));
    bytes.extend(data);
    bytes
}
