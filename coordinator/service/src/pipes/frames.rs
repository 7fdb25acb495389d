//! Messages over a pipe: each after its length in bytes, as a little-endian u64.

use std::io::{self, BufWriter, Read, Write};
use std::sync::Mutex;

use bytes::Bytes;
use prost::Message;

use super::messages::{FromJob, Word};
use crate::sync::lock;

/// The end of a pipe that messages are written to, from any thread.
pub struct Outlet<W: Write> {
    pipe: Mutex<BufWriter<W>>,
}

impl<W: Write> Outlet<W> {
    /// Writes to this pipe.
    pub fn new(pipe: W) -> Self {
        Self { pipe: Mutex::new(BufWriter::with_capacity(64 << 10, pipe)) }
    }

    /// Writes one message.
    ///
    /// # Errors
    /// When the other side is gone.
    pub fn send(&self, message: &impl Message) -> io::Result<()> {
        let bytes = message.encode_to_vec();
        let mut pipe = lock(&self.pipe);
        pipe.write_all(&(bytes.len() as u64).to_le_bytes())?;
        pipe.write_all(&bytes)?;
        pipe.flush()
    }

    /// Sends a word of a job. A service that is gone misses nothing: the job ends with its input.
    pub fn say(&self, word: Word) {
        let _ = self.send(&FromJob { word: Some(word) });
    }
}

/// Reads one message; `None` at the end of the pipe.
///
/// # Errors
/// When the pipe breaks within a message, or its bytes are none.
pub fn receive<M: Message + Default>(pipe: &mut impl Read) -> io::Result<Option<M>> {
    let mut length = [0; 8];
    if let Err(error) = pipe.read_exact(&mut length) {
        return if error.kind() == io::ErrorKind::UnexpectedEof { Ok(None) } else { Err(error) };
    }
    // Grows with what comes: a broken length takes no memory.
    let (mut bytes, length) = (vec![], u64::from_le_bytes(length));
    if pipe.take(length).read_to_end(&mut bytes)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    M::decode(Bytes::from(bytes)).map(Some).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_out_as_they_went_in() {
        let words =
            [Word::Failed("why".into()), Word::Withdraw(true), Word::Release(vec![7; 1 << 20].into())];
        let mut pipe = vec![];
        let outlet = Outlet::new(&mut pipe);
        for word in &words {
            outlet.send(&FromJob { word: Some(word.clone()) }).unwrap();
        }
        drop(outlet);
        let mut rest = pipe.as_slice();
        for word in words {
            assert_eq!(receive(&mut rest).unwrap(), Some(FromJob { word: Some(word) }));
        }
        assert_eq!(receive::<FromJob>(&mut rest).unwrap(), None);
        let mut cut = &pipe[..pipe.len() - 1];
        while let Ok(Some(FromJob { .. })) = receive(&mut cut) {}
        assert!(cut.is_empty());
        let mut absurd = [0xff_u8; 9].as_slice();
        assert!(receive::<FromJob>(&mut absurd).is_err(), "a length that nothing has");
    }
}
