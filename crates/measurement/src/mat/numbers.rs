//! Numbers of a MAT file, in either byte order.

/// Byte order of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

/// Storage type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Int64,
    Uint64,
    Single,
    Double,
}

impl ByteOrder {
    /// Integer of the first four bytes; zero if there are fewer.
    pub(super) fn integer(self, bytes: &[u8]) -> u32 {
        let four = bytes.first_chunk::<4>().copied().unwrap_or_default();
        match self {
            Self::Little => u32::from_le_bytes(four),
            Self::Big => u32::from_be_bytes(four),
        }
    }
}

impl Storage {
    /// Size of a number \[bytes\].
    pub(super) fn size(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Single => 4,
            Self::Int64 | Self::Uint64 | Self::Double => 8,
        }
    }

    /// Decodes numbers. Infinities become NaN; an incomplete number at the end is left out.
    pub(super) fn numbers(self, bytes: &[u8], order: ByteOrder) -> Vec<f64> {
        macro_rules! each {
            ($number:ty) => {
                bytes
                    .chunks_exact(size_of::<$number>())
                    .map(|bytes| {
                        let mut copy = [0; size_of::<$number>()];
                        copy.copy_from_slice(bytes);
                        match order {
                            ByteOrder::Little => <$number>::from_le_bytes(copy) as f64,
                            ByteOrder::Big => <$number>::from_be_bytes(copy) as f64,
                        }
                    })
                    .map(|v: f64| if v.is_finite() { v } else { f64::NAN })
                    .collect()
            };
        }
        match self {
            Self::Int8 => each!(i8),
            Self::Uint8 => each!(u8),
            Self::Int16 => each!(i16),
            Self::Uint16 => each!(u16),
            Self::Int32 => each!(i32),
            Self::Uint32 => each!(u32),
            Self::Int64 => each!(i64),
            Self::Uint64 => each!(u64),
            Self::Single => each!(f32),
            Self::Double => each!(f64),
        }
    }
}
