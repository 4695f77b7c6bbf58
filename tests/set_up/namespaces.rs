//! Network namespaces: one per robot, joined by links that can be cut, made deaf at one end, or made slow, without a trace.

use std::collections::BTreeMap;
use std::io::Write;
use std::process::{Command, Stdio};

/// Robots' namespaces and the links between them. Every link runs over a bridge of its own in a namespace of
/// their own; a cut takes one end off the bridge, so that both sides notice nothing but silence.
pub struct Namespaces {
    prefix: String,
    nodes: u32,
    links: BTreeMap<(u32, u32), usize>,
}

impl Namespaces {
    /// Makes `nodes` namespaces and the links between them.
    ///
    /// # Panics
    /// When a step fails.
    #[must_use]
    pub fn new(nodes: u32, links: &[(u32, u32)]) -> Self {
        static COUNT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let count = COUNT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let prefix = format!("gt{}x{count}", std::process::id());
        let links: BTreeMap<_, _> = links.iter().enumerate().map(|(k, pair)| (*pair, k)).collect();
        let made = Self { prefix, nodes, links };
        for name in made.names() {
            ip(None, &format!("netns add {name}\n"));
            ip(Some(&name), "link set lo up\n");
        }
        let hub = made.hub();
        for ((a, b), k) in &made.links {
            ip(
                Some(&hub),
                &format!(
                    "link add br{k} type bridge forward_delay 0\nlink set br{k} up\n\
                     link add h{k}a type veth peer name e{k} netns {na}\n\
                     link add h{k}b type veth peer name e{k} netns {nb}\n\
                     link set h{k}a master br{k}\nlink set h{k}b master br{k}\n\
                     link set h{k}a up\nlink set h{k}b up\n",
                    na = made.name(*a),
                    nb = made.name(*b),
                ),
            );
            for (node, host) in [(*a, 1), (*b, 2)] {
                let name = made.name(node);
                let address = address(*k, host);
                ip(Some(&name), &format!("addr add {address}/30 dev e{k}\nlink set e{k} up\n"));
            }
        }
        made
    }

    fn names(&self) -> Vec<String> {
        (0..self.nodes).map(|node| self.name(node)).chain([self.hub()]).collect()
    }

    fn hub(&self) -> String {
        format!("{}hub", self.prefix)
    }

    /// The name of a robot's namespace.
    #[must_use]
    pub fn name(&self, node: u32) -> String {
        format!("{}n{node}", self.prefix)
    }

    /// The links, in order.
    pub fn links(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.links.keys().copied()
    }

    /// Where node `b` of the link `(a, b)` can be reached from `a`, for all links that begin at `a`: a link is
    /// dialled from its first end only.
    #[must_use]
    pub fn to_dial(&self, a: u32, port: u16) -> Vec<String> {
        let from_a = self.links.iter().filter(|((first, _), _)| *first == a);
        from_a.map(|(_, k)| format!("tcp/{}:{port}", address(*k, 2))).collect()
    }

    /// Cuts a link without either side being told.
    ///
    /// # Panics
    /// When there is no such link.
    pub fn cut(&self, link: (u32, u32)) {
        let k = self.links[&link];
        ip(Some(&self.hub()), &format!("link set h{k}a nomaster\n"));
    }

    /// Heals a link.
    ///
    /// # Panics
    /// When there is no such link.
    pub fn heal(&self, link: (u32, u32)) {
        let k = self.links[&link];
        ip(Some(&self.hub()), &format!("link set h{k}a master br{k}\n"));
    }

    /// Nothing that is sent over that link reaches `node`, at one of its ends, any more; what it says itself arrives.
    ///
    /// # Panics
    /// When there is no such link.
    pub fn deafen(&self, link: (u32, u32), node: u32) {
        // A queue that no packet fits into.
        self.queue(link, node, "bfifo limit 1");
    }

    /// So many bytes a second go over that link each way, and no more: what is beyond waits, up to a second's worth.
    ///
    /// # Panics
    /// When there is no such link.
    pub fn narrow(&self, link: (u32, u32), bytes_per_second: u32) {
        let (rate, limit) = (8 * u64::from(bytes_per_second), bytes_per_second.max(2 * BURST));
        for node in [link.0, link.1] {
            self.queue(link, node, &format!("tbf rate {rate}bit burst {BURST} limit {limit}"));
        }
    }

    /// Takes back what [`Self::deafen`] and [`Self::narrow`] did to a link.
    ///
    /// # Panics
    /// When there is no such link.
    pub fn widen(&self, link: (u32, u32)) {
        for node in [link.0, link.1] {
            self.queue(link, node, "pfifo limit 1000");
        }
    }

    /// What becomes of the packets of a link that are on their way to `node`.
    fn queue(&self, link: (u32, u32), node: u32, discipline: &str) {
        let (k, end) = (self.links[&link], if node == link.0 { 'a' } else { 'b' });
        let command = format!("qdisc replace dev h{k}{end} root {discipline}\n");
        batch("tc", Some(&self.hub()), &command);
    }
}

/// What may go at once over a link that is narrow, in bytes: more than the largest packet of an Ethernet.
const BURST: u32 = 2000;

impl Drop for Namespaces {
    fn drop(&mut self) {
        for name in self.names() {
            let _ = Command::new("ip").args(["netns", "del", &name]).stderr(Stdio::null()).status();
        }
    }
}

fn address(link: usize, host: usize) -> String {
    format!("10.77.{}.{}", link / 60, link % 60 * 4 + host)
}

fn ip(namespace: Option<&str>, commands: &str) {
    batch("ip", namespace, commands);
}

/// Gives commands to a program of iproute2.
fn batch(program: &str, namespace: Option<&str>, commands: &str) {
    let mut command = Command::new(program);
    if let Some(namespace) = namespace {
        command.args(["-n", namespace]);
    }
    let mut child = command.args(["-batch", "-"]).stdin(Stdio::piped()).spawn().expect("iproute2 is here");
    let written = child.stdin.take().expect("stdin is piped").write_all(commands.as_bytes());
    let ended = child.wait();
    assert!(
        written.is_ok() && ended.is_ok_and(|status| status.success()),
        "{program} {namespace:?} {commands}"
    );
}
