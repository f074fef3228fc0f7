//! A network of UDP between client and server that can be cut, delays packets and loses some.

use std::collections::VecDeque;
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_testing::Background;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// What happens to packets.
#[derive(Default)]
pub struct Conditions {
    pub cut: AtomicBool,
    /// Of packets to the server and back.
    pub delay_ms: [AtomicU64; 2],
    pub lost_percent: AtomicU64,
}

pub struct Relay {
    pub conditions: Arc<Conditions>,
    /// Where the client finds it.
    pub address: String,
    _running: Background,
}

impl Relay {
    pub fn to(server: &str) -> Self {
        let [near, far] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        far.connect(server).unwrap();
        near.set_nonblocking(true).unwrap();
        far.set_nonblocking(true).unwrap();
        let address = near.local_addr().unwrap().to_string();
        let conditions = Arc::<Conditions>::default();
        let now = Arc::clone(&conditions);
        let running = Background::start(move |stop| carry(&near, &far, &now, stop));
        Self { conditions, address, _running: running }
    }
}

/// Carries packets until `stop`.
fn carry(near: &UdpSocket, far: &UdpSocket, conditions: &Conditions, stop: &AtomicBool) {
    let (mut random, mut buffer) = (Pcg64Mcg::new(1), [0; 65_536]);
    let mut client = None;
    let mut delayed = [(); 2].map(|()| VecDeque::<(Nanos, Vec<u8>)>::new());
    while !stop.load(Ordering::Relaxed) {
        let mut take = |direction: usize, packet: &[u8]| {
            if random.random_range(0..100) >= conditions.lost_percent.load(Ordering::Relaxed) {
                let delay = conditions.delay_ms[direction].load(Ordering::Relaxed);
                let due = clock::now() + Nanos::from_millis(delay);
                delayed[direction].push_back((due, packet.to_vec()));
            }
        };
        while let Ok((length, from)) = near.recv_from(&mut buffer) {
            client = Some(from);
            take(0, &buffer[..length]);
        }
        while let Ok(length) = far.recv(&mut buffer) {
            take(1, &buffer[..length]);
        }
        let is_cut = conditions.cut.load(Ordering::Relaxed);
        for (direction, packets) in delayed.iter_mut().enumerate() {
            while packets.front().is_some_and(|(due, _)| *due <= clock::now()) {
                match (packets.pop_front(), client, direction) {
                    (Some((_, packet)), _, 0) if !is_cut => drop(far.send(&packet)),
                    (Some((_, packet)), Some(client), _) if !is_cut => {
                        drop(near.send_to(&packet, client));
                    }
                    _ => {}
                }
            }
        }
        clock::sleep(Nanos::from_micros(100));
    }
}
