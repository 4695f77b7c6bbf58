//! How a camera of this machine is set up, by Video4Linux.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// How a V4L2 camera is set up, beside the size and rate that its model says. A camera may refuse each of it; what was asked for
/// and refused is logged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeviceSettings {
    /// The pixel format, four characters as V4L2 names them: `MJPG`, `YUYV`, `GREY`. `v4l2-ctl --list-formats-ext` lists a
    /// camera's.
    pub format: String,
    /// How long each frame is exposed, 100 µs to 10 s; `None`: as the camera chooses. A fixed one keeps the rate in dim light, and
    /// moving hands sharp.
    #[serde(with = "humantime_serde")]
    pub exposure: Option<Duration>,
    /// The sensor's gain, in the driver's own units (`v4l2-ctl --list-ctrls`); `None`: as the camera chooses.
    pub gain: Option<u32>,
    /// Buffers of the driver, 2 to 10. With fewer than three it has none to fill while the last frame is converted, and loses
    /// every other one.
    pub buffers: u32,
}

impl Default for DeviceSettings {
    /// Compressed frames, for uncompressed most USB cameras have no room for more than 5 to 10 large ones a second; and four
    /// buffers: one being filled, one waiting, one being converted, and one to spare. None grows old in them: they are emptied
    /// all the time.
    fn default() -> Self {
        Self { format: "MJPG".to_owned(), exposure: None, gain: None, buffers: 4 }
    }
}

impl DeviceSettings {
    /// The pixel format as V4L2 numbers it; `None` when it is no four printable ASCII characters.
    #[must_use]
    pub fn fourcc(&self) -> Option<[u8; 4]> {
        let code: [u8; 4] = self.format.as_bytes().try_into().ok()?;
        code.iter().all(|byte| (b' '..=b'~').contains(byte)).then_some(code)
    }

    /// Checks every value against its range.
    ///
    /// # Errors
    /// What is wrong, and the range.
    pub fn validate(&self) -> Result<(), String> {
        if self.fourcc().is_none() {
            return Err(format!("format is '{}': four characters, such as MJPG or YUYV", self.format));
        }
        let exposures = Duration::from_micros(100)..=Duration::from_secs(10);
        if let Some(exposure) = self.exposure.filter(|it| !exposures.contains(it)) {
            return Err(format!("exposure is {exposure:?}: choose a value from 100us to 10s, or null"));
        }
        if !(2..=10).contains(&self.buffers) {
            return Err(format!("buffers is {}: choose a value from 2 to 10", self.buffers));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_camera_can_be_set_to_is_refused_with_the_range() {
        assert_eq!(DeviceSettings::default().validate(), Ok(()));
        for (settings, cause) in [
            (DeviceSettings { format: "MJPEG".to_owned(), ..DeviceSettings::default() }, "four characters"),
            (DeviceSettings { format: "Mün".to_owned(), ..DeviceSettings::default() }, "four characters"),
            (DeviceSettings { exposure: Some(Duration::ZERO), ..DeviceSettings::default() }, "100us"),
            (DeviceSettings { exposure: Some(Duration::MAX), ..DeviceSettings::default() }, "10s"),
            (DeviceSettings { buffers: 1, ..DeviceSettings::default() }, "2 to 10"),
        ] {
            let error = settings.validate().unwrap_err();
            assert!(error.contains(cause), "{error}");
        }
    }
}
