//! Bytes received instead of a valid reply: the evidence for a message, in fixed memory.

use std::fmt;

use crate::drive::serial_frame::SerialFrame;

/// Bytes that are kept: a short reply, or a word of text.
const KEPT: usize = 12;

/// Bytes received instead of a valid reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct UnexpectedReply {
    family: &'static str,
    bytes: u32,
    frames: u32,
    /// A frame came after the wait for it had ended.
    late: bool,
    /// The beginning of the last frame, or the last bytes if there was none.
    last: [u8; KEPT],
    kept: u8,
}

impl UnexpectedReply {
    /// Nothing received yet from a drive of this family.
    pub(in crate::drive) fn none_from(family: &'static str) -> Self {
        Self { family, ..Self::default() }
    }

    pub(crate) fn is_silence(&self) -> bool {
        (self.bytes, self.frames) == (0, 0)
    }

    pub fn is_frame(&self) -> bool {
        self.frames > 0
    }

    pub(in crate::drive) fn note_bytes(&mut self, bytes: &[u8]) {
        self.bytes = self.bytes.saturating_add(bytes.len() as u32);
        if self.is_frame() {
            return;
        }
        for &byte in &bytes[bytes.len().saturating_sub(KEPT)..] {
            if usize::from(self.kept) == KEPT {
                self.last.rotate_left(1);
                self.kept -= 1;
            }
            self.keep(byte);
        }
    }

    /// Records a whole frame that is not a reply to the request, or one that `is_late`: it may be
    /// the reply to an earlier request, which timed out.
    pub(in crate::drive) fn note_frame(&mut self, frame: &SerialFrame<'_>, is_late: bool) {
        if is_late {
            self.late = true;
            return;
        }
        self.frames = self.frames.saturating_add(1);
        self.kept = 0;
        // The opcode of every reply is 0 and says nothing.
        let opcode = (frame.opcode != 0).then_some(frame.opcode);
        opcode.iter().chain(frame.data).take(KEPT).for_each(|&byte| self.keep(byte));
    }

    /// Whether replies came, but after the wait for them.
    pub fn is_late(&self) -> bool {
        self.frames == 0 && self.late
    }

    fn keep(&mut self, byte: u8) {
        if let Some(free) = self.last.get_mut(usize::from(self.kept)) {
            *free = byte;
            self.kept += 1;
        }
    }
}

impl fmt::Display for UnexpectedReply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { family, bytes, frames, late, .. } = self;
        match (bytes, frames) {
            (0, 0) => return f.write_str("the line is silent"),
            (_, 0) if *late => return f.write_str("a reply came too late"),
            (1, 0) => f.write_str("received 1 byte, not a drive frame:")?,
            (_, 0) => write!(f, "received {bytes} bytes, not a drive frame:")?,
            (_, 1) => write!(f, "received a frame, but not a reply of {family}:")?,
            _ => write!(f, "received {frames} frames, but not a reply of {family}, the last:")?,
        }
        let last = self.last.get(..usize::from(self.kept)).unwrap_or_default();
        last.iter().try_for_each(|byte| write!(f, " {byte:02X}"))?;
        let is_text = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
        if !self.is_frame() && last.iter().all(is_text) {
            write!(f, " (text: {:?})", String::from_utf8_lossy(last).trim())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn received_bytes_are_described_in_one_clause() {
        let mut unexpected = UnexpectedReply::none_from("EPOS2");
        assert_eq!(unexpected.to_string(), "the line is silent");
        let mut late = unexpected;
        late.note_bytes(&[0; 14]);
        late.note_frame(&SerialFrame { opcode: 0, data: &[6, 0] }, true);
        assert!(late.is_late() && late.to_string() == "a reply came too late", "{late}");
        unexpected.note_bytes(b"roll=0.1 pitch=-3.4\r\n");
        assert_eq!(
            unexpected.to_string(),
            "received 21 bytes, not a drive frame: 70 69 74 63 68 3D 2D 33 2E \
             34 0D 0A (text: \"pitch=-3.4\")"
        );
        unexpected.note_frame(&SerialFrame { opcode: 0, data: &[6, 0] }, false);
        assert_eq!(unexpected.to_string(), "received a frame, but not a reply of EPOS2: 06 00");
        unexpected.note_frame(&SerialFrame { opcode: 0x60, data: &[1; 300] }, false);
        unexpected.note_bytes(&[7; 300]);
        let echo =
            "2 frames, but not a reply of EPOS2, the last: 60 01 01 01 01 01 01 01 01 01 01 01";
        assert!(unexpected.to_string().ends_with(echo), "{unexpected}");
    }
}
