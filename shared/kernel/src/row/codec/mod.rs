//! Rows on the wire.
//!
//! | module | what lives there |
//! |---|---|
//! | `bits` | numbers of any width one after the other |
//! | `scale` | what the factors of a group are written relative to |

mod bits;
mod scale;
#[cfg(test)]
mod tests;

use bytes::Bytes;

use self::bits::{BitReader, BitWriter};
use self::scale::{Scale, WIDTH_BITS};
use super::Row;
use super::sparse::{GROUP, Group};

/// Why bytes are not a row.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum RowDecodeError {
    /// The bytes end too early, or go on after the last factor.
    #[error("row of {0} bytes is longer or shorter than its groups")]
    Length(usize),
    /// The groups name receivers beyond the last.
    #[error("row of {0} receivers has a factor beyond the last one")]
    BeyondEnd(usize),
    /// There is a shorter way to write the row.
    #[error("row is not written in the shortest form")]
    NotShortest,
    /// A factor is NaN, infinite or a zero that the groups should have left out.
    #[error("row has a factor that is not positive and finite")]
    NotPositive,
}

/// Bits of a positive f32.
const FACTOR_BITS: u32 = 31;

/// Bits that say how many trailing zeros all factors have.
const SHIFT_BITS: u32 = 5;

/// The bits of an infinite f32: those of all positive and finite ones lie between it and 0, in their order.
const INFINITE: u32 = f32::INFINITY.to_bits();

/// Largest encoded length of a row, in bytes.
#[must_use]
pub fn longest_encoded_row(receivers: u32) -> u64 {
    most_bytes(u64::from(receivers).div_ceil(GROUP as u64), receivers.into())
}

fn most_bytes(groups: u64, factors: u64) -> u64 {
    // Most digits of a gap, tags and mask, width and quotient.
    let group = 2 * 31 + 1 + 4 + u32::BITS + WIDTH_BITS + FACTOR_BITS;
    (u64::from(SHIFT_BITS) + groups * u64::from(group) + factors * u64::from(FACTOR_BITS)).div_ceil(8)
}

/// Encodes a row, without loss. It is a string of bits, the lowest bit of a number first:
///
/// 1. in 5 bits the number of trailing zeros that the bits of all factors, as f32, have: factors are written without them;
/// 2. for each group of 32 receivers of which one has a factor that is not 0:
///    1. 1 + the number of groups left out before it, in Elias's gamma code (n zeros, and the number's n + 1 digits from the
///       first on; the digits after the first lowest first);
///    2. its mask with a bit for each receiver that has a factor, in four bytes, the first receiver's bit lowest: first a bit
///       for each byte, 0 where all bits of it are as the last one of the byte before (ones before the first byte), then the
///       other bytes;
///    3. in 5 bits the width of what follows for each factor, w; let s = w - 3, or 0 if that is less;
///    4. the quotient of the least factor and 2^s, in as many bits as a factor can have after it;
///    5. for each factor its difference from this quotient times 2^s, in w bits;
/// 3. zeros up to a full byte.
///
/// w is the least with which this can be done. A row without factors has no bytes. Factors are taken as whole numbers here: as
/// positive numbers of f32 are ordered as their bits, those of one group are close together.
///
/// With factors rounded to 13 binary digits a receiver among others that see the shooter costs about 15 bits, and one in the dark
/// between them one. A dark room costs nothing.
///
/// # Panics
/// When a factor is negative, infinite or NaN: no row is better than one that means something else at the other end.
#[must_use]
pub fn encode_row(row: &Row) -> Bytes {
    if row.factors.is_empty() {
        return Bytes::new();
    }
    let bits = row.factors.iter().map(|factor| factor.to_bits());
    assert!(bits.clone().fold(0, u32::max) < INFINITE, "factors are positive and finite");
    let shift = bits.fold(0, |all, bits| all | bits).trailing_zeros();
    let mut writer = BitWriter::with_capacity(8 + 8 * row.groups.len() + 2 * row.factors.len());
    writer.put(shift, SHIFT_BITS);
    let mut next = 0;
    let mut rest = row.factors.as_ref();
    for group in &row.groups {
        writer.put_gamma(group.index - next + 1);
        next = group.index + 1;
        write_mask(&mut writer, group.mask);
        let (own, others) = rest.split_at(group.mask.count_ones() as usize);
        rest = others;
        let codes = own.iter().map(|factor| factor.to_bits() >> shift);
        let (least, largest) = codes.clone().fold((u32::MAX, 0), |(a, b), code| (a.min(code), b.max(code)));
        let scale = Scale::new(least, largest);
        writer.put(scale.width, WIDTH_BITS);
        writer.put(scale.quotient, FACTOR_BITS - shift - scale.step());
        codes.for_each(|code| writer.put(code - scale.first(), scale.width));
    }
    writer.finish().into()
}

/// Decodes a row over this number of receivers.
///
/// # Errors
/// When the bytes cannot have come from [`encode_row`].
pub fn decode_row(bytes: &[u8], receivers: usize) -> Result<Row, RowDecodeError> {
    let length = || RowDecodeError::Length(bytes.len());
    if bytes.is_empty() {
        return Ok(Row::from_parts(receivers, vec![], vec![]));
    }
    let mut reader = BitReader::new(bytes);
    let shift = reader.take(SHIFT_BITS);
    if shift >= FACTOR_BITS {
        return Err(RowDecodeError::NotPositive);
    }
    // Memory is allocated for the bytes that are there, not for what they announce: a factor takes two, or comes with its group.
    let (mut groups, mut factors) = (vec![], Vec::with_capacity(bytes.len() / 2));
    let mut next = 0_u64;
    let mut used_bits = 0;
    while !reader.is_at_padding() {
        let gap = reader.take_gamma().ok_or_else(length)? - 1;
        let index = next + u64::from(gap);
        next = index + 1;
        let mask = read_mask(&mut reader)?;
        if index * GROUP as u64 + u64::from(mask.ilog2()) >= receivers as u64 {
            return Err(RowDecodeError::BeyondEnd(receivers));
        }
        groups.push(Group { index: index as u32, mask });
        let scale = read_scale(&mut reader, shift)?;
        let visible = mask.count_ones();
        if reader.left() < (visible * scale.width) as usize {
            return Err(length());
        }
        let mut codes = [0; GROUP];
        let codes = &mut codes[..visible as usize];
        let (mut least, mut largest) = (u32::MAX, 0);
        for code in codes.iter_mut() {
            *code = scale.first() + reader.take(scale.width);
            least = least.min(*code);
            largest = largest.max(*code);
            used_bits |= *code;
        }
        if least == 0 || largest > (INFINITE - 1) >> shift {
            return Err(RowDecodeError::NotPositive);
        }
        if Scale::new(least, largest) != scale {
            return Err(RowDecodeError::NotShortest);
        }
        factors.extend(codes.iter().map(|code| f32::from_bits(code << shift)));
    }
    if reader.is_beyond_end() {
        return Err(length());
    }
    if used_bits & 1 == 0 {
        return Err(RowDecodeError::NotShortest);
    }
    Ok(Row::from_parts(receivers, groups, factors))
}

/// What a byte of a mask is after these bits of it, if nothing changes.
fn repeated(before: u32) -> u32 {
    (before >> 7) * 0xff
}

/// Without branches, as [`read_mask`]: which bytes are written cannot be predicted.
fn write_mask(writer: &mut BitWriter, mask: u32) {
    let (mut tags, mut bytes, mut width, mut before) = (0, 0_u64, 0, 0xff);
    for (i, byte) in mask.to_le_bytes().map(u32::from).into_iter().enumerate() {
        let is_written = u32::from(byte != repeated(before));
        tags |= is_written << i;
        bytes |= u64::from(byte * is_written) << width;
        width += 8 * is_written;
        before = byte;
    }
    writer.put(tags, 4);
    writer.put(bytes as u32, width);
}

fn read_mask(reader: &mut BitReader) -> Result<u32, RowDecodeError> {
    let mut bits = reader.peek();
    let tags = bits as u32 & 0xf;
    bits >>= 4;
    reader.skip(4 + 8 * tags.count_ones());
    let (mut mask, mut before, mut is_shortest) = (0, 0xff, true);
    for i in 0..4 {
        let is_written = tags >> i & 1 == 1;
        let (written, expected) = (bits as u32 & 0xff, repeated(before));
        let byte = if is_written { written } else { expected };
        is_shortest &= !is_written || written != expected;
        bits >>= 8 * u32::from(is_written);
        mask |= byte << (8 * i);
        before = byte;
    }
    if is_shortest && mask != 0 { Ok(mask) } else { Err(RowDecodeError::NotShortest) }
}

fn read_scale(reader: &mut BitReader, shift: u32) -> Result<Scale, RowDecodeError> {
    let width = reader.take(WIDTH_BITS);
    if width > FACTOR_BITS - shift {
        return Err(RowDecodeError::NotShortest);
    }
    let scale = Scale { width, quotient: 0 };
    Ok(Scale { quotient: reader.take(FACTOR_BITS - shift - scale.step()), ..scale })
}
