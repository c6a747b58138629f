//! The headers of a column's pages, looked at before the pages are: what they ask for, they get.
//!
//! A header is a struct of Thrift's compact protocol (`parquet.thrift`, `PageHeader`); of it only sizes and
//! counts are read.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

use ::parquet::basic::Compression;
use lynkeus_expr::Budget;

use crate::incoming::ended;
use lynkeus_answer::Error;

/// Bytes of a value of a dictionary in memory.
const VALUE: u64 = 32;

/// Structs within structs, at most.
const DEEPEST: usize = 32;

/// Why a column's pages are not read.
pub(super) enum Unread {
    /// the headers cannot be those of such pages
    Damaged(&'static str),
    Ended(Error),
}

impl From<io::Error> for Unread {
    fn from(_: io::Error) -> Self {
        Self::Damaged("a column ends within the header of a page")
    }
}

/// Where a column's pages lie in the file: the first byte, and the one after the last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub from: u64,
    pub to: u64,
}

/// The pages of a column within a group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pages {
    pub range: Range,
    pub codec: Compression,
}

impl Pages {
    /// The largest page, in bytes, if there is room for each.
    pub fn largest(self, file: &File, budget: &Budget, name: &str) -> Result<u64, Unread> {
        let (range, is_gzip) = (self.range, matches!(self.codec, Compression::GZIP(_)));
        let mut input = BufReader::with_capacity(4096, file.try_clone()?);
        input.seek(SeekFrom::Start(range.from))?;
        let mut at = range.from;
        let mut largest = 0;
        while at < range.to {
            let mut scan = Scan {
                input: &mut input,
                read: 0,
            };
            let page = scan.page()?;
            let (compressed, whole) = (size(page.compressed)?, size(page.uncompressed)?);
            let values = size(page.values)?;
            at = at.saturating_add(scan.read).saturating_add(compressed);
            if at > range.to {
                return Err(Unread::Damaged("a page is longer than its column"));
            }
            // no value of a dictionary is shorter than a byte
            if page.is_dictionary && values > whole {
                return Err(Unread::Damaged("a dictionary has more values than bytes"));
            }
            let dictionary = if page.is_dictionary {
                VALUE * values
            } else {
                0
            };
            let needed = usize::try_from(compressed + whole + dictionary).unwrap_or(usize::MAX);
            if let (false, Some(spent)) = (budget.affords(needed), budget.spent()) {
                return Err(Unread::Ended(ended(spent, name)));
            }
            largest = largest.max(whole);
            let levels = page.levels()?;
            // a page without values is not taken apart
            if page.is_plain || whole <= levels || !is_gzip {
                input.seek_relative(i64::try_from(compressed).unwrap_or(i64::MAX))?;
                continue;
            }
            input.seek_relative(i64::try_from(levels).unwrap_or(i64::MAX))?;
            let values = &mut input.by_ref().take(compressed.saturating_sub(levels));
            Self::measure(values, whole - levels)?;
            input.seek(SeekFrom::Start(at))?;
        }
        Ok(largest)
    }

    /// Takes a page of gzip apart without keeping it: the library would keep whatever it gives, however long it is.
    fn measure(page: &mut dyn Read, whole: u64) -> Result<(), Unread> {
        let parts = flate2::read::MultiGzDecoder::new(page);
        match io::copy(&mut parts.take(whole + 1), &mut io::sink()) {
            Ok(length) if length <= whole => Ok(()),
            Ok(_) => Err(Unread::Damaged("a page is longer than it says")),
            Err(_) => Err(Unread::Damaged("a page cannot be decompressed")),
        }
    }
}

/// A size or a count, which has 31 bits.
fn size(number: i64) -> Result<u64, Unread> {
    let size = i32::try_from(number)
        .ok()
        .and_then(|n| u32::try_from(n).ok());
    size.map(u64::from)
        .ok_or(Unread::Damaged("a page has a size that none can have"))
}

/// What a header says.
#[derive(Debug, Default)]
struct Page {
    uncompressed: i64,
    compressed: i64,
    values: i64,
    is_dictionary: bool,
    /// bytes of its levels where these are not compressed with the values
    levels: [i64; 2],
    /// its values stand as they are
    is_plain: bool,
}

impl Page {
    fn levels(&self) -> Result<u64, Unread> {
        let [definition, repetition] = self.levels;
        Ok(size(definition)? + size(repetition)?)
    }
}

/// Reads Thrift's compact protocol and counts its bytes.
struct Scan<'i> {
    input: &'i mut BufReader<File>,
    read: u64,
}

/// A field of a struct, or its end.
struct Field {
    id: i64,
    kind: u8,
}

impl Scan<'_> {
    fn page(&mut self) -> Result<Page, Unread> {
        let mut page = Page::default();
        let mut last = 0;
        while let Some(field) = self.field(&mut last)? {
            match (field.id, field.kind) {
                (2, 4..=6) => page.uncompressed = self.number()?,
                (3, 4..=6) => page.compressed = self.number()?,
                (7, 12) => {
                    page.is_dictionary = true;
                    page.values = self.dictionary()?;
                }
                (8, 12) => self.second(&mut page)?,
                (_, kind) => self.skip(kind, DEEPEST)?,
            }
        }
        Ok(page)
    }

    /// The header of a page of the second version.
    fn second(&mut self, page: &mut Page) -> Result<(), Unread> {
        let mut last = 0;
        while let Some(field) = self.field(&mut last)? {
            match (field.id, field.kind) {
                (id @ (5 | 6), 4..=6) => page.levels[usize::from(id == 6)] = self.number()?,
                // a truth value is a kind of its own
                (7, kind @ (1 | 2)) => page.is_plain = kind == 2,
                (_, kind) => self.skip(kind, DEEPEST)?,
            }
        }
        Ok(())
    }

    /// How many values a dictionary has.
    fn dictionary(&mut self) -> Result<i64, Unread> {
        let (mut last, mut values) = (0, 0);
        while let Some(field) = self.field(&mut last)? {
            match (field.id, field.kind) {
                (1, 4..=6) => values = self.number()?,
                (_, kind) => self.skip(kind, DEEPEST)?,
            }
        }
        Ok(values)
    }

    fn field(&mut self, last: &mut i64) -> Result<Option<Field>, Unread> {
        let head = self.byte()?;
        if head == 0 {
            return Ok(None);
        }
        *last = match head >> 4 {
            0 => self.number()?,
            step => last.saturating_add(step.into()),
        };
        Ok(Some(Field {
            id: *last,
            kind: head & 0x0f,
        }))
    }

    fn skip(&mut self, kind: u8, depth: usize) -> Result<(), Unread> {
        let Some(depth) = depth.checked_sub(1) else {
            return Err(Unread::Damaged("the header of a page is nested too deeply"));
        };
        match kind {
            1 | 2 => Ok(()),
            3 => self.bytes(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.bytes(8),
            8 => {
                let length = self.varint()?;
                self.bytes(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = match head >> 4 {
                    15 => self.varint()?,
                    count => count.into(),
                };
                (0..count).try_for_each(|_| match head & 0x0f {
                    // a truth value in a list has a byte of its own
                    1 | 2 => self.bytes(1),
                    kind => self.skip(kind, depth),
                })
            }
            12 => {
                let mut last = 0;
                while let Some(field) = self.field(&mut last)? {
                    self.skip(field.kind, depth)?;
                }
                Ok(())
            }
            _ => Err(Unread::Damaged("the header of a page has an unknown field")),
        }
    }

    fn byte(&mut self) -> Result<u8, Unread> {
        let mut byte = [0];
        self.input.read_exact(&mut byte)?;
        self.read += 1;
        Ok(byte[0])
    }

    fn bytes(&mut self, mut count: u64) -> Result<(), Unread> {
        self.read = self.read.saturating_add(count);
        while count > 0 {
            let ready = self.input.fill_buf()?.len();
            let used = ready.min(usize::try_from(count).unwrap_or(usize::MAX));
            if used == 0 {
                return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
            }
            self.input.consume(used);
            count -= used as u64;
        }
        Ok(())
    }

    /// A number of seven bits to the byte.
    fn varint(&mut self) -> Result<u64, Unread> {
        let mut number = 0;
        for place in 0..10 {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(Unread::Damaged(
            "a number in the header of a page has no end",
        ))
    }

    /// The same with its sign in the last bit.
    fn number(&mut self) -> Result<i64, Unread> {
        let number = self.varint()?;
        Ok((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }
}
