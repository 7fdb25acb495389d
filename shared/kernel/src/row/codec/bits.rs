//! Numbers of any width, one after the other in bytes, the lowest bit of each first.

/// Bytes that are read at once.
const WORD: usize = size_of::<u64>();

/// Writes bits.
pub struct BitWriter {
    bytes: Vec<u8>,
    /// Bits that do not fill a word of 32 yet.
    held: u64,
    /// How many.
    count: u32,
}

impl BitWriter {
    /// An empty writer with room for `bytes`.
    pub fn with_capacity(bytes: usize) -> Self {
        Self { bytes: Vec::with_capacity(bytes), held: 0, count: 0 }
    }

    /// Writes the lowest bits of a number, 32 at most.
    pub fn put(&mut self, value: u32, width: u32) {
        debug_assert!(width <= 32 && u64::from(value) < 1 << width);
        self.held |= u64::from(value) << self.count;
        self.count += width;
        if self.count >= 32 {
            self.bytes.extend_from_slice(&(self.held as u32).to_le_bytes());
            self.held >>= 32;
            self.count -= 32;
        }
    }

    /// Writes a number from 1 up in Elias's gamma code: as many zeros as it has digits after its first, a one, and these digits.
    /// Every number has one code, the small ones a short one.
    pub fn put_gamma(&mut self, value: u32) {
        let digits = value.ilog2();
        self.put(0, digits);
        self.put(1, 1);
        self.put(value - (1 << digits), digits);
    }

    /// All that was written; zeros fill the last byte.
    pub fn finish(mut self) -> Vec<u8> {
        let rest = self.count.div_ceil(8) as usize;
        self.bytes.extend_from_slice(&self.held.to_le_bytes()[..rest]);
        self.bytes
    }
}

/// Reads bits; zeros follow the last.
pub struct BitReader<'a> {
    bytes: &'a [u8],
    /// Bits read.
    position: usize,
}

impl<'a> BitReader<'a> {
    /// Begins with the first bit.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    /// Number of bits left.
    pub fn left(&self) -> usize {
        (self.bytes.len() * 8).saturating_sub(self.position)
    }

    /// True once more was read than there is.
    pub fn is_beyond_end(&self) -> bool {
        self.position > self.bytes.len() * 8
    }

    /// The next bits, 57 or more of them.
    pub fn peek(&self) -> u64 {
        let from = self.position / 8;
        let word = match self.bytes.get(from..from + WORD).and_then(|word| word.first_chunk()) {
            Some(word) => u64::from_le_bytes(*word),
            None => last_word(self.bytes.get(from..).unwrap_or_default()),
        };
        word >> (self.position % 8)
    }

    /// Skips some bits.
    pub fn skip(&mut self, bits: u32) {
        self.position += bits as usize;
    }

    /// Reads a number of up to 32 bits.
    pub fn take(&mut self, width: u32) -> u32 {
        let value = self.peek() & ((1 << width) - 1);
        self.skip(width);
        value as u32
    }

    /// Reads a number in Elias's gamma code; `None` where it has more than 28 digits, or there is none.
    pub fn take_gamma(&mut self) -> Option<u32> {
        let digits = self.peek().trailing_zeros();
        if digits > 27 {
            return None;
        }
        self.skip(digits + 1);
        Some(1 << digits | self.take(digits))
    }

    /// True where fewer than eight bits are left, all of them zeros.
    pub fn is_at_padding(&self) -> bool {
        self.left() < 8 && self.peek() == 0
    }
}

/// Fewer bytes than a word has, and zeros after them.
fn last_word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_come_back(numbers in prop::collection::vec((any::<u32>(), 0_u32..=32, 1_u32..1 << 28), 0..60)) {
            let low = |value: u32, width: u32| (u64::from(value) & ((1 << width) - 1)) as u32;
            let mut writer = BitWriter::with_capacity(0);
            for (value, width, counted) in &numbers {
                writer.put(low(*value, *width), *width);
                writer.put_gamma(*counted);
            }
            let bytes = writer.finish();
            let mut reader = BitReader::new(&bytes);
            for (value, width, counted) in &numbers {
                prop_assert_eq!(reader.take(*width), low(*value, *width));
                prop_assert_eq!(reader.take_gamma(), Some(*counted));
            }
            prop_assert!(reader.is_at_padding() && !reader.is_beyond_end());
        }
    }

    #[test]
    fn nothing_is_read_beyond_the_end() {
        let mut reader = BitReader::new(&[0xff]);
        assert_eq!((reader.take(10), reader.left(), reader.is_beyond_end()), (0xff, 0, true));
        assert_eq!((reader.take(32), reader.take_gamma()), (0, None));
        assert_eq!(BitReader::new(&[0, 0, 0, 8]).take_gamma(), Some(1 << 27));
        assert_eq!(BitReader::new(&[0, 0, 0, 16]).take_gamma(), None);
    }
}
