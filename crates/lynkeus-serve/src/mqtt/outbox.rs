//! What is published: each message until the broker has it, and what is acknowledged after that.

use std::collections::VecDeque;

use lynkeus::study::MqttVersion;

use super::packet::{self, Publish, Welcome};

/// Messages that wait, beyond which nothing more is taken.
const MOST: usize = 1024;

/// A message under its place among all.
#[derive(Debug)]
struct Waiting {
    place: u64,
    message: Publish,
}

/// What is to be published, and what was and is not acknowledged yet.
#[derive(Debug)]
pub(super) struct Outbox {
    version: MqttVersion,
    /// whether a broker is asked to acknowledge
    qos: u8,
    waiting: VecDeque<Waiting>,
    /// under their numbers, in order
    sent: VecDeque<(u16, Waiting)>,
    /// messages so far
    count: u64,
    /// the last number
    id: u16,
    /// so many may be sent before they are acknowledged
    room: usize,
    acknowledges: bool,
    /// messages that came, and the place that has to be passed before they are acknowledged
    owed: VecDeque<(u16, u64)>,
}

impl Outbox {
    pub fn new(version: MqttVersion, qos: u8) -> Self {
        Self {
            version,
            qos,
            waiting: VecDeque::new(),
            sent: VecDeque::new(),
            count: 0,
            id: 0,
            room: usize::MAX,
            acknowledges: true,
            owed: VecDeque::new(),
        }
    }

    pub fn push(&mut self, message: Publish) {
        let place = self.count;
        self.count += 1;
        self.waiting.push_back(Waiting { place, message });
    }

    /// The message that came under this number is acknowledged once all that was pushed so far has been.
    pub fn owe(&mut self, id: u16) {
        self.owed.push_back((id, self.count));
    }

    pub fn is_full(&self) -> bool {
        self.waiting.len() + self.sent.len() >= MOST
    }

    /// Nothing is on its way, and nothing is owed.
    pub fn is_done(&self) -> bool {
        self.waiting.is_empty() && self.sent.is_empty() && self.owed.is_empty()
    }

    /// A new connection: what was not acknowledged is sent once more, and what is owed to the one before will come again.
    pub fn begin(&mut self, welcome: &Welcome, to: &mut Vec<u8>) {
        self.owed.clear();
        // with more than there are numbers for, none would be free
        self.room = welcome.on_the_way.min(MOST);
        self.acknowledges = welcome.acknowledges;
        if welcome.has_session && self.sends_ids() {
            for (id, waiting) in &self.sent {
                packet::publish(self.version, &waiting.message, (Some(*id), true), to);
            }
        } else {
            while let Some((_, waiting)) = self.sent.pop_back() {
                self.waiting.push_front(waiting);
            }
        }
    }

    fn sends_ids(&self) -> bool {
        self.qos > 0 && self.acknowledges
    }

    /// Writes what there is room for, then what can be acknowledged.
    pub fn write(&mut self, to: &mut Vec<u8>) {
        while self.sent.len() < self.room
            && let Some(waiting) = self.waiting.pop_front()
        {
            if self.sends_ids() {
                let id = self.free();
                packet::publish(self.version, &waiting.message, (Some(id), false), to);
                self.sent.push_back((id, waiting));
            } else {
                packet::publish(self.version, &waiting.message, (None, false), to);
            }
        }
        let sent = self.sent.front().map(|(_, waiting)| waiting.place);
        let waiting = self.waiting.front().map(|waiting| waiting.place);
        let oldest = sent.or(waiting).unwrap_or(self.count);
        while let Some((id, _)) = self.owed.pop_front_if(|(_, place)| *place <= oldest) {
            packet::acknowledge(id, to);
        }
    }

    /// A number that no message on its way has.
    fn free(&mut self) -> u16 {
        loop {
            self.id = self.id.checked_add(1).unwrap_or(1);
            if self.sent.iter().all(|(id, _)| *id != self.id) {
                return self.id;
            }
        }
    }

    /// The broker has it.
    pub fn is_there(&mut self, id: u16) {
        self.sent.retain(|(own, _)| *own != id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> Publish {
        Publish {
            topic: "t".into(),
            payload: text.into(),
            retain: false,
        }
    }

    /// A row that corrects thousands gives as many messages at once: more than there are numbers for.
    #[test]
    fn any_number_may_wait() {
        let mut outbox = Outbox::new(MqttVersion::V3, 1);
        let welcome = Welcome {
            has_session: false,
            on_the_way: usize::from(u16::MAX),
            acknowledges: true,
        };
        outbox.begin(&welcome, &mut vec![]);
        (0..70_000).for_each(|_| outbox.push(message("a")));
        outbox.owe(1);
        let mut acknowledged = 0;
        while !outbox.is_done() {
            outbox.write(&mut vec![]);
            let ids: Vec<u16> = outbox.sent.iter().map(|(id, _)| *id).collect();
            assert!(ids.len() <= MOST);
            acknowledged += ids.len();
            ids.into_iter().for_each(|id| outbox.is_there(id));
        }
        assert_eq!(acknowledged, 70_000);
    }

    /// What came is acknowledged only after what it gave has arrived, and that is sent again until it has.
    #[test]
    fn nothing_is_acknowledged_before_its_answer_is_there() {
        let mut outbox = Outbox::new(MqttVersion::V3, 1);
        let welcome = Welcome {
            has_session: true,
            on_the_way: 2,
            acknowledges: true,
        };
        let mut bytes = vec![];
        outbox.begin(&welcome, &mut bytes);
        for (id, text) in [(7, "a"), (8, "b"), (9, "c")] {
            outbox.push(message(text));
            outbox.owe(id);
        }
        outbox.write(&mut bytes);
        // two at once
        assert_eq!(bytes, b"\x32\x06\0\x01t\0\x01a\x32\x06\0\x01t\0\x02b");
        bytes.clear();
        outbox.is_there(2);
        outbox.write(&mut bytes);
        assert_eq!(bytes, b"\x32\x06\0\x01t\0\x03c");
        bytes.clear();
        outbox.is_there(1);
        outbox.write(&mut bytes);
        assert_eq!(bytes, b"\x40\x02\0\x07\x40\x02\0\x08");
        // the connection is lost: once more, under its number
        bytes.clear();
        outbox.begin(&welcome, &mut bytes);
        outbox.write(&mut bytes);
        assert_eq!(bytes, b"\x3a\x06\0\x01t\0\x03c");
        outbox.is_there(3);
        assert!(outbox.is_done());
        // the broker forgot everything
        outbox.push(message("d"));
        outbox.write(&mut vec![]);
        bytes.clear();
        let has_session = false;
        outbox.begin(
            &Welcome {
                has_session,
                ..welcome
            },
            &mut bytes,
        );
        outbox.write(&mut bytes);
        assert_eq!(bytes, b"\x32\x06\0\x01t\0\x05d");
    }
}
