//! Tables of a flatbuffer, of which no offset is trusted.

/// A table: where its slots lie is said by another one, before or after it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl<'b> Table<'b> {
    /// The table that the buffer is of.
    pub fn root(bytes: &'b [u8]) -> Option<Self> {
        Some(Self {
            bytes,
            at: follow(bytes, 0)?,
        })
    }

    /// Where a slot's value lies, if the table has it.
    fn slot(self, slot: usize) -> Option<usize> {
        let back = i32::from_le_bytes(taken(self.bytes, self.at)?);
        let at = i64::try_from(self.at).ok()?;
        let slots = usize::try_from(at.checked_sub(back.into())?).ok()?;
        let length = u16::from_le_bytes(taken(self.bytes, slots)?);
        let place = 4 + 2 * slot;
        if place + 2 > usize::from(length) {
            return None;
        }
        let offset = u16::from_le_bytes(taken(self.bytes, slots.checked_add(place)?)?);
        match offset {
            0 => None,
            offset => self.at.checked_add(offset.into()),
        }
    }

    pub fn byte(self, slot: usize) -> Option<u8> {
        self.bytes.get(self.slot(slot)?).copied()
    }

    pub fn short(self, slot: usize) -> Option<u16> {
        taken(self.bytes, self.slot(slot)?).map(u16::from_le_bytes)
    }

    pub fn table(self, slot: usize) -> Option<Self> {
        let at = follow(self.bytes, self.slot(slot)?)?;
        Some(Self { at, ..self })
    }

    pub fn text(self, slot: usize) -> Option<&'b str> {
        let at = follow(self.bytes, self.slot(slot)?)?;
        let length = usize::try_from(u32::from_le_bytes(taken(self.bytes, at)?)).ok()?;
        let text = self.bytes.get(at + 4..)?.get(..length)?;
        std::str::from_utf8(text).ok()
    }

    /// The tables of a list, up to the first that lies outside of the buffer.
    pub fn tables(self, slot: usize) -> impl Iterator<Item = Self> + use<'b> {
        let at = self.slot(slot).and_then(|slot| follow(self.bytes, slot));
        let count = at.and_then(|at| taken(self.bytes, at));
        let count = u32::from_le_bytes(count.unwrap_or_default());
        (1..=u64::from(count)).map_while(move |k| {
            let entry = usize::try_from(4 * k).ok()?.checked_add(at?)?;
            let at = follow(self.bytes, entry)?;
            Some(Self { at, ..self })
        })
    }
}

/// Where the offset at a place leads.
fn follow(bytes: &[u8], at: usize) -> Option<usize> {
    let offset = usize::try_from(u32::from_le_bytes(taken(bytes, at)?)).ok()?;
    at.checked_add(offset).filter(|at| *at < bytes.len())
}

/// Bytes from a place on.
fn taken<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at.checked_add(N)?)?.try_into().ok()
}
