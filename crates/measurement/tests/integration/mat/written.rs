//! MAT files as MATLAB lays them out, for the tests.

use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;

/// An element: its type, the number of its bytes, and these, up to the next multiple of eight.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let mut bytes = kind.to_le_bytes().to_vec();
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(data);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

/// What every matrix begins with.
fn head(name: &str, class: u32, dimensions: &[usize]) -> Vec<u8> {
    let mut bytes = element(6, &[class.to_le_bytes(), [0; 4]].concat());
    let sizes: Vec<u8> = dimensions.iter().flat_map(|d| (*d as u32).to_le_bytes()).collect();
    bytes.extend(element(5, &sizes));
    bytes.extend(element(1, name.as_bytes()));
    bytes
}

/// A matrix of doubles, by columns.
pub fn doubles(name: &str, dimensions: &[usize], values: &[f64]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    element(14, &[head(name, 6, dimensions), element(9, &data)].concat())
}

/// A vector of doubles as a row.
pub fn row(name: &str, values: &[f64]) -> Vec<u8> {
    doubles(name, &[1, values.len()], values)
}

/// A matrix of 32-bit integers, stored as 16-bit ones where they are small, as MATLAB does.
pub fn integers(name: &str, values: &[i32]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| (*v as i16).to_le_bytes()).collect();
    element(14, &[head(name, 12, &[values.len(), 1]), element(3, &data)].concat())
}

/// A row of characters.
pub fn text(name: &str, text: &str) -> Vec<u8> {
    let data: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    element(14, &[head(name, 4, &[1, text.encode_utf16().count()]), element(4, &data)].concat())
}

/// A structure, or an array of them: each element has a matrix without a name for each field.
pub fn structure(name: &str, fields: &[&str], elements: &[Vec<Vec<u8>>]) -> Vec<u8> {
    let mut data = head(name, 2, &[1, elements.len()]);
    data.extend(element(5, &32_u32.to_le_bytes()));
    let names = fields.iter().flat_map(|f| {
        let mut padded = f.as_bytes().to_vec();
        padded.resize(32, 0);
        padded
    });
    data.extend(element(1, &names.collect::<Vec<u8>>()));
    data.extend(elements.iter().flatten().flatten());
    element(14, &data)
}

/// A cell array of a text each.
pub fn cells(name: &str, texts: &[&str]) -> Vec<u8> {
    let mut data = head(name, 1, &[1, texts.len()]);
    data.extend(texts.iter().flat_map(|t| text("", t)));
    element(14, &data)
}

/// An object of a class, of which only the class's name is known.
pub fn object(name: &str, class: &str) -> Vec<u8> {
    let mut data = element(6, &[17_u32.to_le_bytes(), [0; 4]].concat());
    data.extend([name, "MCOS", class].iter().flat_map(|t| element(1, t.as_bytes())));
    data.extend(doubles("", &[1, 1], &[0.0]));
    element(14, &data)
}

/// A variable as level 7 packs it.
pub fn packed(variable: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(variable).unwrap();
    let data = encoder.finish().unwrap();
    let mut bytes = 15_u32.to_le_bytes().to_vec();
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(data);
    bytes
}

/// A file of level 5 to 7.
pub fn file(variables: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec();
    bytes.resize(124, b' ');
    bytes.extend([0x00, 0x01, b'I', b'M']);
    bytes.extend(variables.iter().flatten());
    bytes
}

/// A matrix of level 4; `kind` as in its header: 0 doubles, 20 32-bit integers, 51 characters.
pub fn level_4(name: &str, kind: u32, rows: usize, values: &[f64]) -> Vec<u8> {
    let head = [kind, rows as u32, (values.len() / rows) as u32, 0, name.len() as u32 + 1];
    let mut bytes: Vec<u8> = head.into_iter().flat_map(u32::to_le_bytes).collect();
    bytes.extend(name.as_bytes());
    bytes.push(0);
    bytes.extend(values.iter().flat_map(|v| match kind {
        20 => (*v as i32).to_le_bytes().to_vec(),
        51 => vec![*v as u8],
        _ => v.to_le_bytes().to_vec(),
    }));
    bytes
}

/// Texts as a matrix of characters of level 4, one a column or one a row.
pub fn level_4_texts(name: &str, texts: &[&str], is_transposed: bool) -> Vec<u8> {
    let length = texts.iter().map(|t| t.len()).max().unwrap();
    let padded: Vec<Vec<u8>> = texts.iter().map(|t| format!("{t:length$}").into_bytes()).collect();
    let values: Vec<f64> = match is_transposed {
        true => padded.iter().flatten().map(|c| f64::from(*c)).collect(),
        false => (0..length).flat_map(|k| padded.iter().map(move |t| f64::from(t[k]))).collect(),
    };
    level_4(name, 51, if is_transposed { length } else { texts.len() }, &values)
}
