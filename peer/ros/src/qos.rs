//! How a topic is delivered, as far as ROS nodes read it from a token.

/// A quality of service that differs from `rmw_zenoh`'s default (reliable, volatile, the last 42) in what is said here;
/// deadlines, lifespans and liveliness are the default's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Lost messages are sent again.
    pub reliable: bool,
    /// Who comes late gets the last `depth` messages (in ROS: transient local, or latched).
    pub latched: bool,
    /// How many messages are kept for a slow reader, at least 1.
    pub depth: usize,
}

const DEFAULT_DEPTH: usize = 42;

impl Qos {
    /// For what must arrive: the last `depth` messages.
    #[must_use]
    pub const fn reliable(depth: usize) -> Self {
        Self { reliable: true, latched: false, depth }
    }

    /// For the state of something: who comes late gets the last message.
    #[must_use]
    pub const fn latched() -> Self {
        Self { reliable: true, latched: true, depth: 1 }
    }

    /// For cameras: what is late is worth nothing.
    #[must_use]
    pub const fn sensor_data() -> Self {
        Self { reliable: false, latched: false, depth: 5 }
    }

    /// As a token says it: `reliability:durability:history,depth:deadline:lifespan:liveliness`, where a field that is the
    /// default's is empty.
    #[must_use]
    pub fn to_key(self) -> String {
        let reliability = if self.reliable { "" } else { "2" };
        let durability = if self.latched { "1" } else { "" };
        let depth = if self.depth == DEFAULT_DEPTH { String::new() } else { self.depth.max(1).to_string() };
        format!("{reliability}:{durability}:,{depth}:,:,:,,")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quality_is_written_as_rmw_zenoh_writes_it() {
        assert_eq!(Qos::reliable(7).to_key(), "::,7:,:,:,,");
        assert_eq!(Qos::sensor_data().to_key(), "2::,5:,:,:,,");
        assert_eq!(Qos::latched().to_key(), ":1:,1:,:,:,,");
        assert_eq!(Qos::reliable(42).to_key(), "::,:,:,:,,");
    }
}
