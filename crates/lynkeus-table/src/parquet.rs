//! Logs and estimates as Parquet files.

mod arrow_schema;
mod durations;
mod flatbuffer;
mod meaning;
mod pages;
mod quiet;
mod write;

use std::fs::File;

use ::parquet::basic::Compression;
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{AsBytes, DataType};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};
use ::parquet::file::reader::{FileReader, SerializedFileReader};

use self::durations::Durations;
use self::meaning::Meaning;
use self::pages::{Pages, Range, Unread};
use super::column::Column;
use super::instant::Instant;
use super::lines::Lines;
use super::marks::FileMarks;
use super::{Request, Table};
use crate::incoming::ended;
use crate::series::Store;
use lynkeus_answer::Error;

pub use self::write::write_parquet;

/// Rows that are read or written at a time.
const BATCH: usize = 8192;

/// Bytes of a column that is decoded though nobody asks for it: where a part of a file is damaged, who knows of the rest.
const SMALL: i64 = 16 << 20;

/// Bytes that a batch of texts may take.
const TEXTS: u64 = 16 << 20;

/// Reads a Parquet file; its rows count from 1 in messages.
///
/// # Errors
/// The file is no Parquet file or cut short or damaged, has no rows, there is no room for its
/// numbers, or the budget is spent.
pub(super) fn load(file: File, name: &str, request: &Request) -> Result<Table, Error> {
    let loading = Loading {
        name,
        request,
        store: Store::default(),
    };
    // the library panics at some damaged files
    quiet::caught(|| loading.table(file))
        .unwrap_or_else(|| Err(loading.damaged("its parts contradict each other")))
}

/// The refusal of what is no file.
pub(super) fn no_file(name: &str) -> Error {
    Error::input("a Parquet file is read from its end: expected a file, found a stream")
        .at(name)
        .hint("save it first")
}

/// A file while it is read.
struct Loading<'l> {
    name: &'l str,
    request: &'l Request,
    store: Store,
}

impl Loading<'_> {
    fn table(&self, file: File) -> Result<Table, Error> {
        let broken = |e: ParquetError| self.damaged(&e.to_string());
        let own = file.try_clone().map_err(|e| self.damaged(&e.to_string()))?;
        let reader = SerializedFileReader::new(file).map_err(broken)?;
        let metadata = reader.metadata();
        let rows = self.rows(metadata)?;
        let schema = metadata.file_metadata().schema_descr();
        let durations = Durations::of(metadata.file_metadata());
        let mut columns = Vec::new();
        for (index, described) in schema.columns().iter().enumerate() {
            let header = described.path().string();
            if described.max_rep_level() > 0 {
                // a list in every row: no column of numbers
                continue;
            }
            let mut column = Column::new(&header, &self.store);
            let meaning = durations.meaning(described);
            match meaning {
                Meaning::Other(what) => column.refuse(
                    0,
                    format!("expected numbers or dates, found {what}"),
                    "convert them before",
                ),
                _ if !self.request.wants(&header) && !is_small(metadata, index) => column.leave(),
                _ => {
                    for group in 0..metadata.num_row_groups() {
                        let group = reader.get_row_group(group).map_err(broken)?;
                        self.refuse_codec(group.metadata().column(index))?;
                        let largest = self.largest(&own, group.metadata().column(index))?;
                        let values = group.get_column_reader(index).map_err(broken)?;
                        let mut chunk = Chunk {
                            loading: self,
                            column: &mut column,
                            meaning,
                            most: described.max_def_level(),
                            rows,
                            largest,
                        };
                        chunk.read(values)?;
                    }
                    if column.values.len() != rows {
                        return Err(self.damaged("its columns differ in length"));
                    }
                    column.finish(FileMarks::default());
                    if !self.request.wants(&header) {
                        column = Column::new(&header, &self.store);
                        column.leave();
                    }
                }
            }
            columns.push(column);
        }
        self.store.check()?;
        Ok(Table {
            file: self.name.to_owned(),
            columns,
            truth: vec![],
            lines: Lines::counted(rows),
            store: self.store.clone(),
        })
    }

    /// The number of rows, of which every part of the file says the same.
    fn rows(&self, metadata: &ParquetMetaData) -> Result<usize, Error> {
        let all = metadata.file_metadata().num_rows();
        let groups = metadata.row_groups();
        let sum = groups.iter().try_fold(0_i64, |sum, group| {
            let flat = |(column, described): (&ColumnChunkMetaData, &_)| {
                let described: &::parquet::schema::types::ColumnDescPtr = described;
                described.max_rep_level() > 0 || column.num_values() == group.num_rows()
            };
            let described = metadata.file_metadata().schema_descr().columns();
            let are_whole = group.columns().iter().zip(described).all(flat);
            let rows = Some(group.num_rows()).filter(|rows| *rows >= 0 && are_whole);
            sum.checked_add(rows?)
        });
        match (sum == Some(all), usize::try_from(all)) {
            (true, Ok(0)) => Err(Error::input("expected rows, found none").at(self.name)),
            (true, Ok(rows)) => Ok(rows),
            _ => Err(self.damaged("its parts differ in length")),
        }
    }

    /// The largest page of a column in a group, if there is room for each.
    fn largest(&self, file: &File, chunk: &ColumnChunkMetaData) -> Result<u64, Error> {
        let from = chunk
            .dictionary_page_offset()
            .unwrap_or(chunk.data_page_offset());
        let range = u64::try_from(from)
            .ok()
            .zip(u64::try_from(chunk.compressed_size()).ok());
        let length = file.metadata().map_or(0, |data| data.len());
        let range = range.and_then(|(from, size)| {
            let to = from.checked_add(size).filter(|to| *to <= length)?;
            Some(Range { from, to })
        });
        let range = range.ok_or_else(|| self.damaged("a column lies outside of it"))?;
        let pages = Pages {
            range,
            codec: chunk.compression(),
        };
        match pages.largest(file, &self.request.budget, self.name) {
            Ok(largest) => Ok(largest),
            Err(Unread::Damaged(why)) => Err(self.damaged(why)),
            Err(Unread::Ended(error)) => Err(error),
        }
    }

    /// Refuses pages that nobody here takes apart.
    fn refuse_codec(&self, chunk: &ColumnChunkMetaData) -> Result<(), Error> {
        let codec = match chunk.compression() {
            Compression::BROTLI(_) => "brotli",
            Compression::LZO => "LZO",
            Compression::LZ4 => "Hadoop's LZ4",
            _ => return Ok(()),
        };
        let message = format!(
            "cannot read the Parquet file: column \"{}\" is compressed by {codec}: expected zstd, snappy, gzip, LZ4_RAW or none",
            chunk.column_path().string()
        );
        Err(Error::input(message)
            .at(self.name)
            .hint("write it with one of these"))
    }

    fn damaged(&self, why: &str) -> Error {
        Error::input(format!("cannot read the Parquet file: {why}"))
            .at(self.name)
            .hint("it is damaged or cut short, or no Parquet file")
    }
}

/// Whether it costs little to see that a column is not damaged, though nobody asks for it.
fn is_small(metadata: &ParquetMetaData, index: usize) -> bool {
    let columns = metadata.row_groups().iter();
    let columns = columns.filter_map(|group| group.columns().get(index));
    // many values may be few bytes
    let bytes = columns.map(|c| c.uncompressed_size().max(c.num_values().saturating_mul(8)));
    bytes.fold(0, i64::saturating_add) <= SMALL
}

/// A column within a group while it is read.
struct Chunk<'c> {
    loading: &'c Loading<'c>,
    column: &'c mut Column,
    meaning: Meaning,
    /// the level of a value that is there
    most: i16,
    /// of the file
    rows: usize,
    /// bytes of its largest page
    largest: u64,
}

impl Chunk<'_> {
    fn read(&mut self, values: ColumnReader) -> Result<(), Error> {
        let meaning = self.meaning;
        match values {
            ColumnReader::DoubleColumnReader(r) => self.each(r, BATCH, |c, x| c.put(*x)),
            ColumnReader::FloatColumnReader(r) => self.each(r, BATCH, |c, x| c.put(f64::from(*x))),
            ColumnReader::BoolColumnReader(r) => {
                self.each(r, BATCH, |c, x| c.put(f64::from(u8::from(*x))))
            }
            ColumnReader::Int32ColumnReader(r) => {
                self.each(r, BATCH, |c, x| meaning.whole(c, i64::from(*x), 32))
            }
            ColumnReader::Int64ColumnReader(r) => {
                self.each(r, BATCH, |c, x| meaning.whole(c, *x, 64))
            }
            ColumnReader::Int96ColumnReader(r) => self.each(r, BATCH, |c, x| {
                c.put_instant(Instant::at(i128::from(x.to_nanos()), false))
            }),
            ColumnReader::ByteArrayColumnReader(r) => {
                let batch = self.texts();
                self.each(r, batch, |c, x| meaning.bytes(c, x.as_bytes()))
            }
            ColumnReader::FixedLenByteArrayColumnReader(r) => {
                let batch = self.texts();
                self.each(r, batch, |c, x| meaning.bytes(c, x.as_bytes()))
            }
        }
    }

    /// Texts that are read at a time: each may repeat the beginning of the one before it, so that it is as long as the page.
    fn texts(&self) -> usize {
        let most = TEXTS / self.largest.max(1);
        usize::try_from(most).unwrap_or(BATCH).clamp(1, BATCH)
    }

    /// Takes every value.
    fn each<T: DataType>(
        &mut self,
        mut reader: ColumnReaderImpl<T>,
        batch: usize,
        mut take: impl FnMut(&mut Column, &T::T),
    ) -> Result<(), Error> {
        let (mut values, mut levels) = (Vec::new(), Vec::new());
        loop {
            if let Some(spent) = self.loading.request.budget.spent() {
                return Err(ended(spent, self.loading.name));
            }
            values.clear();
            levels.clear();
            let room = (self.most > 0).then_some(&mut levels);
            let (rows, ..) = reader
                .read_records(batch, room, None, &mut values)
                .map_err(|e| self.loading.damaged(&e.to_string()))?;
            if rows == 0 {
                return self.loading.store.check();
            }
            if self.column.values.len() + rows > self.rows {
                return Err(self.loading.damaged("its columns differ in length"));
            }
            let mut present = values.iter();
            for row in 0..rows {
                let is_null = levels.get(row).is_some_and(|level| *level < self.most);
                let value = if is_null { None } else { present.next() };
                match value {
                    Some(value) => take(self.column, value),
                    None => self.column.put_nothing(),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
