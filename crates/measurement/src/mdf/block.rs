//! Blocks of an MDF 4 file, after ASAM MDF 4.1: an identification, a length, links to other blocks, data.

use std::collections::HashSet;
use std::io::{Read, Seek, SeekFrom};

/// Largest size of a block other than data \[bytes\].
const LARGEST: u64 = 16 << 20;
/// Longest text that is read \[bytes\].
const LONGEST_TEXT: usize = 10_000;

/// Largest number of conversion links that are followed; nesting multiplies them beyond the number of blocks.
const MOST_CONVERSIONS: usize = 500_000;

/// Reason why a file cannot be used: a sentence without the file's name.
pub(super) type Damage = String;

/// Header of a block: identification, and positions of links and data.
#[derive(Clone, Copy, Debug)]
pub(super) struct Head {
    pub(super) id: [u8; 4],
    pub(super) length: u64,
    pub(super) links: u64,
}

/// A block: links and data.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) id: [u8; 4],
    links: Vec<u64>,
    data: Vec<u8>,
}

/// Block reader of a file.
pub(super) struct Blocks<R> {
    source: R,
    pub(super) size: u64,
    /// Positions of blocks that may be visited only once, so that cyclic lists end.
    visited: HashSet<u64>,
    /// Number of conversion links followed.
    conversions: usize,
}

impl<R: Read + Seek> Blocks<R> {
    pub(super) fn new(mut source: R) -> std::io::Result<Self> {
        let size = source.seek(SeekFrom::End(0))?;
        Ok(Self { source, size, visited: HashSet::new(), conversions: 0 })
    }

    /// Reads bytes at a position; fewer at the end of the file.
    pub(super) fn bytes(&mut self, at: u64, count: u64) -> Result<Vec<u8>, Damage> {
        let mut bytes = Vec::new();
        let read = self.source.seek(SeekFrom::Start(at));
        read.and_then(|_| self.source.by_ref().take(count).read_to_end(&mut bytes))
            .map_err(|e| e.to_string())?;
        Ok(bytes)
    }

    /// Reads the header of a block.
    pub(super) fn head(&mut self, at: u64) -> Result<Head, Damage> {
        let bytes = self.bytes(at, 24)?;
        let id = bytes.first_chunk::<4>().filter(|id| bytes.len() == 24 && id.starts_with(b"##"));
        let id = *id.ok_or_else(|| format!("at byte {at} is no block"))?;
        let (length, links) = (number(&bytes, 8, 8), number(&bytes, 16, 8));
        if links
            .checked_mul(8)
            .and_then(|size| size.checked_add(24))
            .is_none_or(|size| size > length)
        {
            return Err(format!("the block at byte {at} is shorter than its links"));
        }
        Ok(Head { id, length, links })
    }

    /// Reads a block other than data, of one of the given kinds.
    pub(super) fn block(&mut self, at: u64, kinds: &[&[u8; 4]]) -> Result<Block, Damage> {
        let head = self.head(at)?;
        if !kinds.contains(&&head.id) {
            return Err(format!(
                "at byte {at} is {} in place of {}",
                String::from_utf8_lossy(&head.id),
                String::from_utf8_lossy(kinds[0])
            ));
        }
        let size = (head.length - 24).min(LARGEST);
        let bytes = self.bytes(at.saturating_add(24), size)?;
        let (links, data) = bytes
            .split_at_checked(8 * head.links as usize)
            .ok_or_else(|| format!("the file ends within the block at byte {at}"))?;
        let links = links.chunks_exact(8).map(|l| number(l, 0, 8)).collect();
        Ok(Block { id: head.id, links, data: data.to_vec() })
    }

    /// Whether a link of a conversion refers to another conversion; otherwise it refers to a text.
    ///
    /// # Errors
    ///
    /// Description of the damage, or of an exceeded limit of links.
    pub(super) fn is_conversion(&mut self, at: u64) -> Result<bool, Damage> {
        self.conversions += 1;
        if self.conversions > MOST_CONVERSIONS {
            return Err(format!(
                "converted by parts, of which a file has {MOST_CONVERSIONS} at most"
            ));
        }
        Ok(self.head(at)?.id == *b"##CC")
    }

    /// Like `block`, for a block that may be visited only once.
    pub(super) fn next(&mut self, at: u64, kind: &[u8; 4]) -> Result<Block, Damage> {
        self.visit(at)?;
        self.block(at, &[kind])
    }

    /// Marks a block as visited; an error if it was visited before.
    pub(super) fn visit(&mut self, at: u64) -> Result<(), Damage> {
        match self.visited.insert(at) {
            true => Ok(()),
            false => Err(format!("two links refer to the block at byte {at}")),
        }
    }

    /// The text at a link; empty for a null link. For XML (`##MD`) it is the content of the first TX element.
    pub(super) fn text(&mut self, at: u64) -> Result<String, Damage> {
        if at == 0 {
            return Ok(String::new());
        }
        let block = self.block(at, &[b"##TX", b"##MD"])?;
        let end = block.data.iter().position(|b| *b == 0).unwrap_or(block.data.len());
        let text = String::from_utf8_lossy(&block.data[..end.min(LONGEST_TEXT)]).into_owned();
        if block.id == *b"##TX" {
            return Ok(text);
        }
        let inner = text.split_once("<TX>").and_then(|(_, rest)| rest.split_once("</TX>"));
        let inner = inner.map_or("", |(inner, _)| inner);
        let entities =
            [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
        Ok(entities.iter().fold(inner.to_string(), |text, (entity, is)| text.replace(entity, is)))
    }
}

impl Block {
    /// A link; zero if the block has fewer.
    pub(super) fn link(&self, k: usize) -> u64 {
        self.links.get(k).copied().unwrap_or(0)
    }

    /// All links.
    pub(super) fn links(&self) -> &[u64] {
        &self.links
    }

    /// An unsigned integer in the data; zero if the block is shorter, as in older versions.
    pub(super) fn number(&self, at: usize, size: usize) -> u64 {
        number(&self.data, at, size)
    }

    /// A double in the data; `None` if the block is shorter.
    pub(super) fn real(&self, at: usize) -> Option<f64> {
        Some(f64::from_le_bytes(*self.data.get(at..)?.first_chunk()?))
    }
}

/// A little-endian integer of `size` bytes.
pub(super) fn number(bytes: &[u8], at: usize, size: usize) -> u64 {
    let mut all = [0; 8];
    if let Some(part) = bytes.get(at..at + size) {
        all[..size].copy_from_slice(part);
    }
    u64::from_le_bytes(all)
}
