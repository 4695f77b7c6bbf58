//! The standard messages that a swarm exchanges with ROS, as CDR.

use crate::cdr::{CdrError, Reader, Writer};

/// A message of ROS.
pub trait RosMessage: Sized {
    /// Its type as ROS names it: `std_msgs/msg/String`.
    const TYPE: &'static str;
    /// The hash of its definition (REP 2016), from `share/<package>/msg/<name>.json` of the message package.
    const HASH: &'static str;

    /// As it is sent.
    fn encode(&self) -> Vec<u8>;

    /// As it is received.
    ///
    /// # Errors
    /// [`CdrError`] for anything else.
    fn decode(message: &[u8]) -> Result<Self, CdrError>;

    /// Its type as DDS names it: `std_msgs::msg::dds_::String_`.
    #[must_use]
    fn dds_type() -> String {
        let (package, name) = Self::TYPE.split_once("/msg/").unwrap_or((Self::TYPE, ""));
        format!("{package}::msg::dds_::{name}_")
    }
}

/// `std_msgs/msg/String`: a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Text(pub String);

impl RosMessage for Text {
    const TYPE: &'static str = "std_msgs/msg/String";
    const HASH: &'static str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        writer.text(&self.0);
        writer.finish()
    }

    fn decode(message: &[u8]) -> Result<Self, CdrError> {
        Ok(Self(Reader::new(message)?.text()?.to_owned()))
    }
}

/// `std_msgs/msg/Header`: when, and in which frame of reference.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Seconds since 1970, or of a simulation.
    pub seconds: i32,
    /// And nanoseconds, below 10⁹.
    pub nanoseconds: u32,
    /// The frame of reference.
    pub frame: String,
}

impl Header {
    fn write(&self, writer: &mut Writer) {
        writer.i32(self.seconds);
        writer.u32(self.nanoseconds);
        writer.text(&self.frame);
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { seconds: reader.i32()?, nanoseconds: reader.u32()?, frame: reader.text()?.to_owned() })
    }
}

/// `sensor_msgs/msg/CompressedImage`: a picture as JPEG or PNG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CompressedImage {
    /// When it was taken.
    pub header: Header,
    /// `jpeg`, `png`, or as image_transport writes it, `rgb8; jpeg compressed bgr8`.
    pub format: String,
    /// The file.
    pub data: Vec<u8>,
}

impl RosMessage for CompressedImage {
    const TYPE: &'static str = "sensor_msgs/msg/CompressedImage";
    const HASH: &'static str = "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a";

    fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        self.header.write(&mut writer);
        writer.text(&self.format);
        writer.bytes(&self.data);
        writer.finish()
    }

    fn decode(message: &[u8]) -> Result<Self, CdrError> {
        let mut reader = Reader::new(message)?;
        Ok(Self {
            header: Header::read(&mut reader)?,
            format: reader.text()?.to_owned(),
            data: reader.bytes()?.to_owned(),
        })
    }
}

/// `sensor_msgs/msg/Image`: a picture as pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// When it was taken.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// `rgb8`, `bgr8`, `mono8` and others.
    pub encoding: String,
    /// Whether its numbers have the high byte first.
    pub big_endian: bool,
    /// Bytes from one row to the next.
    pub step: u32,
    /// Its rows, `step * height` bytes.
    pub data: Vec<u8>,
}

impl RosMessage for Image {
    const TYPE: &'static str = "sensor_msgs/msg/Image";
    const HASH: &'static str = "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47";

    fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        self.header.write(&mut writer);
        writer.u32(self.height);
        writer.u32(self.width);
        writer.text(&self.encoding);
        writer.u8(self.big_endian.into());
        writer.u32(self.step);
        writer.bytes(&self.data);
        writer.finish()
    }

    fn decode(message: &[u8]) -> Result<Self, CdrError> {
        let mut reader = Reader::new(message)?;
        Ok(Self {
            header: Header::read(&mut reader)?,
            height: reader.u32()?,
            width: reader.u32()?,
            encoding: reader.text()?.to_owned(),
            big_endian: reader.u8()? != 0,
            step: reader.u32()?,
            data: reader.bytes()?.to_owned(),
        })
    }
}

impl Image {
    /// Its pixels as blue, green, red, row by row without gaps.
    ///
    /// # Errors
    /// [`CdrError::Field`] for an encoding other than `bgr8`, `rgb8` and `mono8`, or when there are not as many bytes as it
    /// states.
    pub fn to_bgr(&self) -> Result<Vec<u8>, CdrError> {
        let channels: u32 = match self.encoding.as_str() {
            "bgr8" | "rgb8" => 3,
            "mono8" => 1,
            other => {
                let other: String = other.chars().take(32).collect();
                return Err(CdrError::Field(format!(
                    "the picture is encoded as '{other}': have it published as bgr8, rgb8 or mono8, or compressed"
                )));
            }
        };
        let (width, height, step) = (self.width, self.height, self.step);
        let row = width.checked_mul(channels).filter(|row| *row > 0 && *row <= step);
        let whole = u64::from(step) * u64::from(height);
        let Some(row) = row.filter(|_| height > 0 && whole == self.data.len() as u64) else {
            let bytes = self.data.len();
            return Err(CdrError::Field(format!(
                "{bytes} bytes are no picture of {width}×{height} pixels in rows of {step} bytes"
            )));
        };
        let rows = self.data.chunks_exact(step as usize).flat_map(|whole| &whole[..row as usize]);
        Ok(match self.encoding.as_str() {
            "mono8" => rows.flat_map(|&grey| [grey; 3]).collect(),
            "rgb8" => {
                let mut pixels: Vec<u8> = rows.copied().collect();
                pixels.chunks_exact_mut(3).for_each(<[u8]>::reverse);
                pixels
            }
            _ => rows.copied().collect(),
        })
    }
}

/// How a part of a robot does, as `rqt_robot_monitor` and Foxglove show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Level {
    /// Well.
    Ok = 0,
    /// It works, but somebody should look.
    Warn = 1,
    /// It does not work.
    Error = 2,
    /// It was not heard of lately.
    Stale = 3,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`: one part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How it does.
    pub level: Level,
    /// What it is.
    pub name: String,
    /// How it does, in words.
    pub message: String,
    /// Which machine it belongs to.
    pub hardware_id: String,
    /// Its numbers, by name.
    pub values: Vec<(String, String)>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`: all parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostics {
    /// When.
    pub header: Header,
    /// The parts.
    pub status: Vec<Diagnostic>,
}

impl RosMessage for Diagnostics {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
    const HASH: &'static str = "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e";

    fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        self.header.write(&mut writer);
        writer.length(self.status.len());
        for part in &self.status {
            writer.u8(part.level as u8);
            writer.text(&part.name);
            writer.text(&part.message);
            writer.text(&part.hardware_id);
            writer.length(part.values.len());
            for (key, value) in &part.values {
                writer.text(key);
                writer.text(value);
            }
        }
        writer.finish()
    }

    fn decode(message: &[u8]) -> Result<Self, CdrError> {
        let mut reader = Reader::new(message)?;
        let header = Header::read(&mut reader)?;
        let mut status = Vec::new();
        for _ in 0..reader.u32()? {
            status.push(Diagnostic::read(&mut reader)?);
        }
        Ok(Self { header, status })
    }
}

impl Diagnostic {
    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        let level = match reader.u8()? {
            0 => Level::Ok,
            1 => Level::Warn,
            2 => Level::Error,
            3 => Level::Stale,
            other => return Err(CdrError::Field(format!("{other} is no level: 0 to 3"))),
        };
        let mut text = || reader.text().map(str::to_owned);
        let (name, message, hardware_id) = (text()?, text()?, text()?);
        let mut values = Vec::new();
        for _ in 0..reader.u32()? {
            values.push((reader.text()?.to_owned(), reader.text()?.to_owned()));
        }
        Ok(Self { level, name, message, hardware_id, values })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn header() -> Header {
        Header { seconds: 1, nanoseconds: 2, frame: "camera".to_owned() }
    }

    fn picture() -> CompressedImage {
        CompressedImage { header: header(), format: "jpeg".to_owned(), data: vec![1, 2, 3, 4, 5] }
    }

    fn image(encoding: &str, step: u32, data: Vec<u8>) -> Image {
        let (height, width) = (2, 1);
        Image {
            header: header(),
            height,
            width,
            encoding: encoding.to_owned(),
            big_endian: false,
            step,
            data,
        }
    }

    fn diagnostics() -> Diagnostics {
        let part = |name: &str, values: &[(&str, &str)]| Diagnostic {
            level: Level::Warn,
            name: name.to_owned(),
            message: "slow".to_owned(),
            hardware_id: "robot 3".to_owned(),
            values: values.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect(),
        };
        Diagnostics {
            header: header(),
            status: vec![part("a", &[]), part("bc", &[("fps", "2"), ("state", "live")])],
        }
    }

    fn hexadecimal(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// What `rclpy.serialization.serialize_message` of ROS 2 Kilted wrote for the same messages, with zeros between the fields,
    /// where it leaves whatever was in its memory.
    #[test]
    fn messages_are_the_bytes_that_ros_writes() {
        assert_eq!(hexadecimal(&Text("three".to_owned()).encode()), "0001000006000000746872656500");
        assert_eq!(hexadecimal(&Text(String::new()).encode()), GOLDEN_EMPTY);
        assert_eq!(hexadecimal(&picture().encode()), GOLDEN_PICTURE);
        assert_eq!(hexadecimal(&image("mono8", 1, vec![7, 8]).encode()), GOLDEN_IMAGE);
        assert_eq!(hexadecimal(&diagnostics().encode()), GOLDEN_DIAGNOSTICS);
    }

    const GOLDEN_EMPTY: &str = "000100000100000000";
    const GOLDEN_PICTURE: &str = concat!(
        "0001000001000000020000000700000063616d65726100",
        "00050000006a7065670000000005000000",
        "0102030405"
    );
    const GOLDEN_IMAGE: &str = concat!(
        "0001000001000000020000000700000063616d65726100",
        "000200000001000000060000006d6f6e6f3800000001000000020000000708"
    );
    const GOLDEN_DIAGNOSTICS: &str = concat!(
        "0001000001000000020000000700000063616d65726100",
        "0002000000010000000200000061000000",
        "05000000736c6f770000000008000000726f626f7420330000000000",
        "010000000300000062630000",
        "05000000736c6f770000000008000000726f626f7420330002000000",
        "04000000667073000200000032000000060000007374617465000000050000006c69766500"
    );

    #[test]
    fn what_is_written_is_read_again() {
        assert_eq!(CompressedImage::decode(&picture().encode()), Ok(picture()));
        assert_eq!(Diagnostics::decode(&diagnostics().encode()), Ok(diagnostics()));
        let image = image("bgr8", 4, vec![1, 2, 3, 0, 4, 5, 6, 0]);
        assert_eq!(Image::decode(&image.encode()), Ok(image));
    }

    #[test]
    fn pictures_of_any_encoding_become_blue_green_red_without_gaps() {
        assert_eq!(image("bgr8", 4, vec![1, 2, 3, 0, 4, 5, 6, 0]).to_bgr(), Ok(vec![1, 2, 3, 4, 5, 6]));
        assert_eq!(image("rgb8", 3, vec![1, 2, 3, 4, 5, 6]).to_bgr(), Ok(vec![3, 2, 1, 6, 5, 4]));
        assert_eq!(image("mono8", 2, vec![1, 0, 2, 0]).to_bgr(), Ok(vec![1, 1, 1, 2, 2, 2]));
        assert!(image("16UC1", 2, vec![0; 4]).to_bgr().unwrap_err().to_string().contains("16UC1"));
        for (step, bytes) in [(2, 6), (3, 5), (3, 7), (0, 0), (u32::MAX, 6)] {
            assert!(image("bgr8", step, vec![0; bytes]).to_bgr().is_err(), "{step} {bytes}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_a_reader_panic_or_grow(which in 0..4, at: prop::sample::Index, byte: u8, cut: prop::sample::Index) {
            let mut message = match which {
                0 => Text("three".to_owned()).encode(),
                1 => picture().encode(),
                2 => image("mono8", 1, vec![7, 8]).encode(),
                _ => diagnostics().encode(),
            };
            let at = at.index(message.len());
            message[at] = byte;
            message.truncate(cut.index(message.len() + 1));
            let _ = Text::decode(&message);
            let _ = CompressedImage::decode(&message);
            let _ = Diagnostics::decode(&message);
            let _ = Image::decode(&message).map(|image| image.to_bgr());
        }
    }
}
