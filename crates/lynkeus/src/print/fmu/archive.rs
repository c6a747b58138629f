//! Archives as PKWARE's APPNOTE describes them, files stored as they are.

/// 1980-01-01, the first day that the format knows: the same files give the same archive.
const DATE: u16 = (1 << 5) | 1;

/// An archive with these files, in this order.
pub(super) fn stored(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = vec![];
    let mut directory = vec![];
    for (name, content) in files {
        let place = archive.len();
        let facts = facts(name, content);
        // local header: signature, version 2.0
        archive.extend(b"PK\x03\x04\x14\x00");
        archive.extend(&facts);
        archive.extend(name.as_bytes());
        archive.extend(content);
        // the same in the directory: made by version 2.0 on Unix, needs 2.0
        directory.extend(b"PK\x01\x02\x14\x03\x14\x00");
        directory.extend(&facts);
        // no comment, first disk, no attributes inside, a plain file outside
        directory.extend([0; 6]);
        directory.extend((0o100_644_u32 << 16).to_le_bytes());
        directory.extend(size(place).to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (place, length) = (archive.len(), directory.len());
    let count = u16::try_from(files.len()).unwrap_or(u16::MAX);
    archive.extend(directory);
    archive.extend(b"PK\x05\x06\x00\x00\x00\x00");
    archive.extend(count.to_le_bytes());
    archive.extend(count.to_le_bytes());
    archive.extend(size(length).to_le_bytes());
    archive.extend(size(place).to_le_bytes());
    archive.extend([0; 2]);
    archive
}

/// What both headers say: flags (names are UTF-8), method, time, date, checksum, sizes, lengths.
fn facts(name: &str, content: &[u8]) -> Vec<u8> {
    let mut facts = vec![];
    for half in [1 << 11, 0, 0, DATE] {
        facts.extend(u16::to_le_bytes(half));
    }
    for whole in [checksum(content), size(content.len()), size(content.len())] {
        facts.extend(whole.to_le_bytes());
    }
    let length = u16::try_from(name.len()).unwrap_or(u16::MAX);
    facts.extend(length.to_le_bytes());
    // nothing extra
    facts.extend([0; 2]);
    facts
}

/// Sources and a library are far below the 4 GiB of the format.
fn size(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

/// CRC-32 of ISO 3309.
fn checksum(content: &[u8]) -> u32 {
    let byte = |remainder: u32, byte: &u8| {
        (0..8).fold(remainder ^ u32::from(*byte), |r, _| {
            let is_odd = r & 1 == 1;
            (r >> 1) ^ if is_odd { 0xedb8_8320 } else { 0 }
        })
    };
    !content.iter().fold(u32::MAX, byte)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_is_that_of_the_standard() {
        // the check value of the catalogue of CRC algorithms
        assert_eq!(checksum(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn an_archive_lists_its_files() {
        let files = [
            ("a.txt".to_owned(), b"one".to_vec()),
            ("b/c".to_owned(), vec![]),
        ];
        let archive = stored(&files);
        let end = archive.len() - 22;
        assert_eq!(&archive[end..end + 4], b"PK\x05\x06");
        assert_eq!(archive[end + 10], 2);
        let number =
            |at: usize| u32::from_le_bytes(archive[at..at + 4].try_into().unwrap()) as usize;
        let (length, directory) = (number(end + 12), number(end + 16));
        assert_eq!(directory + length, end);
        assert_eq!(&archive[directory..directory + 4], b"PK\x01\x02");
        assert_eq!(&archive[directory + 46..directory + 51], b"a.txt");
        assert_eq!(&archive[35..38], b"one");
    }
}
