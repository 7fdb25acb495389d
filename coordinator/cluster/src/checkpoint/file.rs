//! A checkpoint on disk: a header, then records.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;

use files::LockedFile;
use kernel::replica::Digest;
use kernel::row::release;

use super::error::CheckpointError;
use super::record::{HEAD, TAIL, decode_head, is_whole};

/// First bytes of every checkpoint.
const MAGIC: &[u8] = b"halflight checkpoint\n";

/// Longest line with the release, in bytes.
const LONGEST_RELEASE: u64 = 100;

/// Place of a record's body, with its checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    pub offset: u64,
    pub length: usize,
}

/// A checkpoint, locked by this process.
pub struct CheckpointFile {
    pub file: LockedFile,
    /// Records found.
    pub index: HashMap<Digest, Place>,
    /// Length of the file in bytes.
    pub length: u64,
}

impl CheckpointFile {
    /// Opens or creates a checkpoint. Bytes after the last whole record are cut off.
    pub fn open(path: &Path) -> Result<Self, CheckpointError> {
        let failed = |error| CheckpointError::Io { path: path.to_owned(), error };
        let mut options = OpenOptions::new();
        let file = options.read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        let locked = LockedFile::of(file).map_err(failed)?;
        let file = locked.ok_or_else(|| CheckpointError::InUse { path: path.to_owned() })?;
        let mut reader = BufReader::with_capacity(1 << 20, &*file);
        let header = [MAGIC, release().as_bytes(), b"\n"].concat();
        let mut found = vec![];
        reader.by_ref().take(MAGIC.len() as u64).read_to_end(&mut found).map_err(failed)?;
        if found.len() < MAGIC.len() && MAGIC.starts_with(&found) {
            // New, or interrupted before its first record.
            begin(&file, &header).map_err(failed)?;
            return Ok(Self { file, index: HashMap::new(), length: header.len() as u64 });
        }
        if found != MAGIC {
            return Err(CheckpointError::NotACheckpoint { path: path.to_owned() });
        }
        let line = read_line(&mut reader).map_err(failed)?;
        match line {
            None => {
                begin(&file, &header).map_err(failed)?;
                Ok(Self { file, index: HashMap::new(), length: header.len() as u64 })
            }
            Some(theirs) if theirs != release() => {
                Err(CheckpointError::Version { path: path.to_owned(), theirs, ours: release() })
            }
            Some(_) => {
                let (index, length) = scan(&mut reader, header.len() as u64).map_err(failed)?;
                file.set_len(length).map_err(failed)?;
                (&*file).seek(SeekFrom::Start(length)).map_err(failed)?;
                Ok(Self { file, index, length })
            }
        }
    }
}

/// Reads the body and checksum of a record.
pub fn read(file: &File, place: Place) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; place.length];
    file.read_exact_at(&mut bytes, place.offset)?;
    Ok(bytes)
}

fn begin(mut file: &File, header: &[u8]) -> io::Result<()> {
    file.set_len(0)?;
    file.seek(SeekFrom::Start(0))?;
    file.write_all(header)
}

/// Reads the rest of a line; `None` if the file ends before.
fn read_line(reader: &mut impl BufRead) -> io::Result<Option<String>> {
    let mut line = vec![];
    reader.take(LONGEST_RELEASE).read_until(b'\n', &mut line)?;
    let ended = line.pop_if(|last| *last == b'\n').is_some();
    let is_line = ended || line.len() as u64 == LONGEST_RELEASE;
    Ok(is_line.then(|| String::from_utf8_lossy(&line).into_owned()))
}

/// Finds all whole records, and the end of the last one. A damaged record is skipped, and costs its own row only, if its length is
/// right.
fn scan(reader: &mut impl Read, first: u64) -> io::Result<(HashMap<Digest, Place>, u64)> {
    let mut index = HashMap::new();
    let (mut at, mut end) = (first, first);
    let mut bytes = vec![];
    loop {
        let mut head = [0; HEAD];
        if !fill(reader, &mut head)? {
            return Ok((index, end));
        }
        let Some((key, body)) = decode_head(&head) else { return Ok((index, end)) };
        let length = body + TAIL;
        bytes.resize(length, 0);
        if !fill(reader, &mut bytes)? {
            return Ok((index, end));
        }
        let offset = at + HEAD as u64;
        at = offset + length as u64;
        if is_whole(key, &bytes) {
            index.insert(key, Place { offset, length });
            end = at;
        }
    }
}

/// Fills `bytes`; false if the file ends before.
fn fill(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<bool> {
    match reader.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}
