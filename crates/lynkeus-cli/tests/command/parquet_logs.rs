//! Logs as Parquet files that other tools write.

use std::sync::Arc;

use parquet::basic::{Compression, GzipLevel, ZstdLevel};
use parquet::data_type::{DataType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterVersion};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use crate::{Ended, Folder, csv};

const ROWS: i32 = 40;

/// What polars writes of t: duration(us), y: double, u: double.
const ARROW: &str = "/////8YAAAAEAAAA8v///xQAAAAEAAEAAAAKAAsACAAKAAQA+P///wwAAAAIAAgAAAAEAAMAAABcAAAAMAAAAAQAAACc////HAAAABAAAAAIAAAAAQMAAAAAAACa////AgAAAAEAAAB1AAAAxP///xwAAAAQAAAACAAAAAEDAAAAAAAAwv///wIAAAABAAAAeQAAAOz///8wAAAAIAAAABgAAAABEgAAEAASAAQAEAARAAgAAAAMAAAAAAD6////AgAGAAYABAABAAAAdAA=";

/// A decay with a sensor, and a log of it that is yet to be written.
fn folder() -> Folder {
    let folder = Folder::empty();
    folder.write(
        "m.mo",
        "model M Real x(start=1,min=0,max=2); output Real y = x; equation der(x) = -x; end M;",
    );
    let study =
        "plant = \"m.mo\"\n[sensors]\nnoise = { y = 0.001 }\n[observer]\nfamily = \"ekf\"\n";
    folder.write("s.toml", study);
    folder
}

fn column<T: DataType>(group: &mut SerializedRowGroupWriter<'_, std::fs::File>, values: &[T::T]) {
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<T>().write_batch(values, None, None).unwrap();
    column.close().unwrap();
}

/// Writes `log.parquet`: times `per_second` in whole numbers, so declared, and the readings.
fn write(folder: &Folder, time: &str, per_second: i64, properties: WriterProperties) {
    let schema = format!("message log {{ required int64 t {time}; required double y; }}");
    let schema = Arc::new(parse_message_type(&schema).unwrap());
    let file = std::fs::File::create(folder.path.path().join("log.parquet")).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let steps = 0..ROWS;
    let times: Vec<i64> = steps
        .clone()
        .map(|k| i64::from(k) * per_second / 20)
        .collect();
    let readings: Vec<f64> = steps.map(|k| (-f64::from(k) / 20.0).exp()).collect();
    column::<Int64Type>(&mut group, &times);
    column::<DoubleType>(&mut group, &readings);
    group.close().unwrap();
    writer.close().unwrap();
}

fn estimated(folder: &Folder) -> Ended {
    folder.run(&["estimate", "s.toml", "log.parquet"])
}

fn last_time(ended: &Ended) -> f64 {
    // times that were read wrong are no decay
    let is_read = ended.code == 0 || ended.err.contains("not credible");
    assert!(is_read, "{}", ended.err);
    let (_, rows) = csv(&ended.out);
    assert_eq!(rows.len(), ROWS as usize);
    rows[rows.len() - 1][0]
}

fn saying(key: &str, value: &str) -> WriterProperties {
    let said = KeyValue::new(key.to_owned(), value.to_owned());
    let properties = WriterProperties::builder();
    properties.set_key_value_metadata(Some(vec![said])).build()
}

fn pandas(unit: &str) -> String {
    format!(r#"{{"columns": [{{"field_name": "t", "numpy_type": "timedelta64[{unit}]"}}]}}"#)
}

#[test]
fn durations_are_seconds_whoever_wrote_them() {
    let folder = folder();
    write(&folder, "", 1_000_000, saying("ARROW:schema", ARROW));
    assert_eq!(last_time(&estimated(&folder)), 1.95);
    let units = [
        ("s", 20),
        ("ms", 1000),
        ("us", 1_000_000),
        ("ns", 1_000_000_000),
    ];
    for (unit, per_second) in units {
        write(&folder, "", per_second, saying("pandas", &pandas(unit)));
        let expected = if unit == "s" { 39.0 } else { 1.95 };
        assert_eq!(last_time(&estimated(&folder)), expected, "{unit}");
    }
    // fastparquet, by either kind of annotation
    for time in ["(TIME(MICROS, true))", "(TIME_MICROS)"] {
        write(&folder, time, 1_000_000, saying("pandas", &pandas("ns")));
        assert_eq!(last_time(&estimated(&folder)), 1.95, "{time}");
    }
    // neither numbers of nobody nor dates are durations
    write(&folder, "", 20, WriterProperties::builder().build());
    assert_eq!(last_time(&estimated(&folder)), 39.0);
    let dates = "(TIMESTAMP(MICROS, true))";
    write(&folder, dates, 1_000_000, saying("ARROW:schema", ARROW));
    let ended = estimated(&folder);
    assert_eq!(last_time(&ended), 1.95);
    assert!(
        ended.err.contains("since 1970-01-01T00:00:00Z"),
        "{}",
        ended.err
    );
}

#[test]
fn durations_of_a_plant_in_hours_are_refused() {
    let folder = folder();
    folder.write(
        "s.toml",
        &(folder.read("s.toml") + "[plot]\ntime_unit = \"h\"\n"),
    );
    write(&folder, "", 1_000_000, saying("ARROW:schema", ARROW));
    let ended = estimated(&folder);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(
        ended.err.contains("are durations, which count in seconds"),
        "{}",
        ended.err
    );
}

#[test]
fn every_codec_is_read() {
    let folder = folder();
    let codecs = [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(ZstdLevel::default()),
        Compression::GZIP(GzipLevel::default()),
        Compression::LZ4_RAW,
    ];
    for codec in codecs {
        for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
            let properties = WriterProperties::builder().set_compression(codec);
            write(
                &folder,
                "",
                20,
                properties.set_writer_version(version).build(),
            );
            assert_eq!(last_time(&estimated(&folder)), 39.0, "{codec}");
        }
    }
}

#[test]
fn a_codec_that_is_not_read_is_named() {
    let folder = folder();
    let properties = WriterProperties::builder().set_compression(Compression::LZ4);
    write(&folder, "", 20, properties.build());
    let ended = estimated(&folder);
    assert_eq!(ended.code, 2, "{}", ended.err);
    let words =
        "column \"t\" is compressed by Hadoop's LZ4: expected zstd, snappy, gzip, LZ4_RAW or none";
    assert!(ended.err.contains(words), "{}", ended.err);
}
