//! The order of a program's operations: calls early, those on the longest way to an output first, as far as
//! registers last. A processor looks some hundred operations ahead by itself, which are few chains of a long sum.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use lynkeus_expr::{Binary, Unary};

use crate::record::{Id, Program, Value};

/// Operations that begin in a cycle.
const WIDTH: u32 = 4;

/// Cycles between two divisions or roots.
const DIVIDER: u32 = 5;

/// How many operations another one may overtake.
const WINDOW: usize = 1000;

/// Cycles that are waited for an operation that gives a register back, where there are none.
const PATIENCE: u32 = 4;

/// Cycles until the result is there.
fn latency(value: Value) -> u32 {
    match value {
        Value::Input(_) | Value::Constant(_) | Value::Entry(..) => 0,
        Value::Unary(Unary::Neg | Unary::Abs, _) => 1,
        Value::Unary(Unary::Sqrt, _) => 20,
        Value::Unary(..) => 8,
        Value::Binary(Binary::Add | Binary::Sub | Binary::Mul, ..) | Value::Fused(..) => 4,
        Value::Binary(Binary::Div, ..) => 14,
        Value::Binary(..) | Value::Select(..) | Value::Choice(..) => 6,
        Value::Solve(_) => 50,
    }
}

fn divides(value: Value) -> bool {
    matches!(
        value,
        Value::Binary(Binary::Div, ..) | Value::Unary(Unary::Sqrt, _)
    )
}

/// Whether a value stands in memory from the beginning, or from its system's solution on.
fn is_leaf(value: Value) -> bool {
    matches!(
        value,
        Value::Input(_) | Value::Constant(_) | Value::Entry(..)
    )
}

/// The program in a better order, and without what nothing needs. A call, which empties the registers, comes as
/// soon as it can. Where one number is computed with at a time, other operations are put into the order in which
/// a processor is through with them soonest; groups of lanes are many, and go on beside each other.
pub(crate) fn scheduled(
    program: &Program,
    registers: usize,
    is_single: bool,
    is_call: impl Fn(Value) -> bool,
) -> Program {
    let mut scheduler = Scheduler::new(program, registers);
    let is_ordered = is_single && scheduler.is_deep();
    let mut section = vec![];
    for id in called_early(program, &scheduler.is_needed, &is_call) {
        let value = program.values[id as usize];
        if matches!(value, Value::Input(_) | Value::Constant(_)) || !is_ordered {
            scheduler.is_begun[id as usize] = true;
            scheduler.order.push(id);
        } else if is_call(value) {
            scheduler.run(&std::mem::take(&mut section));
            scheduler.issue(id);
        } else {
            section.push(id);
        }
    }
    scheduler.run(&section);
    scheduler.result()
}

/// What is needed in its order, but each call, with what it needs, before all that it does not need.
fn called_early(
    program: &Program,
    is_needed: &[bool],
    is_call: &impl Fn(Value) -> bool,
) -> Vec<Id> {
    let needed = (0..)
        .zip(&program.values)
        .filter(|(id, _)| is_needed[*id as usize]);
    let (mut order, mut is_placed) = (vec![], vec![false; is_needed.len()]);
    let mut place = |id: Id, order: &mut Vec<Id>| {
        let is_new = !std::mem::replace(&mut is_placed[id as usize], true);
        if is_new {
            order.push(id);
        }
        is_new
    };
    for (id, value) in needed.clone() {
        if let Value::Input(_) = value {
            place(id, &mut order);
        }
    }
    for (call, _) in needed.clone().filter(|(_, value)| is_call(**value)) {
        let (mut cone, mut open) = (vec![], vec![call]);
        while let Some(id) = open.pop() {
            if place(id, &mut cone) {
                program.each_argument(program.values[id as usize], |argument| open.push(argument));
            }
        }
        // arguments are numbered before their users
        cone.sort_unstable();
        order.extend(cone);
    }
    for (id, _) in needed {
        place(id, &mut order);
    }
    order
}

/// An operation that waits for its turn: those on the longest way first, then in their order.
type Waiting = (u32, Reverse<Id>);

struct Scheduler<'p> {
    program: &'p Program,
    registers: usize,
    is_needed: Vec<bool>,
    /// cycles from the beginning of an operation to the end of all that need it
    height: Vec<u32>,
    /// users to come, and all their numbers, one over the other: the last one's where there is one
    uses: Vec<u32>,
    users: Vec<Id>,
    /// whether it is the last user of an argument that has a register
    frees: Vec<bool>,
    /// arguments that are not begun
    missing: Vec<u32>,
    /// the users that wait for a value: each with the place of the one before, the last one's by the value
    links: Vec<(Id, Option<u32>)>,
    last_user: Vec<Option<u32>>,
    /// when a result is there
    done: Vec<u32>,
    is_begun: Vec<bool>,
    /// when the arguments of an operation that waits are there
    at: Vec<Option<u32>>,
    /// values that want a register
    live: usize,
    now: u32,
    /// operations that began in this cycle
    begun: u32,
    divider: u32,
    order: Vec<Id>,
    queue: Queue,
}

/// Operations whose arguments are begun.
#[derive(Default)]
struct Queue {
    /// those whose turn is far
    far: BinaryHeap<Reverse<Id>>,
    /// those that wait for arguments, by the time of these
    waiting: BinaryHeap<Reverse<(u32, Reverse<u32>, Id)>>,
    /// those that may begin
    open: BinaryHeap<Waiting>,
    /// those that may begin when the divider is free
    dividing: BinaryHeap<Waiting>,
    /// of those that wait, and of those that may begin, the ones that give a register back
    coming: BinaryHeap<Reverse<(u32, Reverse<u32>, Id)>>,
    freeing: BinaryHeap<Waiting>,
}

impl<'p> Scheduler<'p> {
    fn new(program: &'p Program, registers: usize) -> Self {
        let count = program.values.len();
        let mut scheduler = Self {
            program,
            registers,
            is_needed: vec![false; count],
            height: vec![0; count],
            uses: vec![0; count],
            users: vec![0; count],
            frees: vec![false; count],
            missing: vec![0; count],
            links: vec![],
            last_user: vec![None; count],
            done: vec![0; count],
            is_begun: vec![false; count],
            at: vec![None; count],
            live: 0,
            now: 0,
            begun: 0,
            divider: 0,
            order: vec![],
            queue: Queue::default(),
        };
        scheduler.measure();
        scheduler
    }

    /// What is needed, how far from the end it is, and who uses it.
    fn measure(&mut self) {
        for &output in &self.program.outputs {
            self.is_needed[output as usize] = true;
        }
        for (i, &value) in self.program.values.iter().enumerate().rev() {
            self.is_needed[i] |= !Program::is_pure(value) || matches!(value, Value::Input(_));
            if !self.is_needed[i] {
                continue;
            }
            self.height[i] += latency(value);
            let height = self.height[i];
            each_once(self.program, value, |argument| {
                let argument = argument as usize;
                self.is_needed[argument] = true;
                self.height[argument] = height.max(self.height[argument]);
                self.uses[argument] += 1;
                self.users[argument] ^= i as Id;
            });
        }
        for id in 0..self.program.values.len() as Id {
            self.note_last_user(id);
        }
    }

    /// Whether the longest way takes long beside all operations. Where it does not, neighbours have little to do
    /// with each other, and a processor needs no help.
    fn is_deep(&self) -> bool {
        let longest = self.height.iter().max().copied().unwrap_or(0);
        2 * (WIDTH * longest) as usize >= self.program.values.len()
    }

    fn value(&self, id: Id) -> Value {
        self.program.values[id as usize]
    }

    /// The operations between two calls, in their order.
    fn run(&mut self, section: &[Id]) {
        let (mut known, mut missing) = (vec![], vec![]);
        for &id in section {
            let (uses, is_begun) = (&mut missing, &self.is_begun);
            let before = uses.len();
            each_once(self.program, self.value(id), |argument| {
                if !is_begun[argument as usize] {
                    uses.push((argument, id));
                }
            });
            self.missing[id as usize] = (missing.len() - before) as u32;
            if missing.len() == before {
                known.push(Reverse(id));
            }
        }
        for (argument, user) in missing {
            let last = self.last_user[argument as usize].replace(self.links.len() as u32);
            self.links.push((user, last));
        }
        self.queue.far.extend(known);
        let mut first = 0;
        while first < section.len() {
            let end = section.get(first + WINDOW).copied().unwrap_or(Id::MAX);
            self.approach(end);
            let id = self.next();
            self.issue(id);
            while section
                .get(first)
                .is_some_and(|&id| self.is_begun[id as usize])
            {
                first += 1;
            }
            let mut link = self.last_user[id as usize];
            while let Some(place) = link {
                let (user, before) = self.links[place as usize];
                self.missing[user as usize] -= 1;
                if self.missing[user as usize] == 0 {
                    self.queue.far.push(Reverse(user));
                }
                link = before;
            }
        }
    }

    /// Those before `end` whose arguments are begun wait for these.
    fn approach(&mut self, end: Id) {
        while let Some(&Reverse(id)) = self.queue.far.peek() {
            if id >= end {
                return;
            }
            self.queue.far.pop();
            let at = self.arguments_done(id);
            self.at[id as usize] = Some(at);
            let entry = (at, Reverse(self.height[id as usize]), id);
            self.queue.waiting.push(Reverse(entry));
            if self.frees[id as usize] {
                self.queue.coming.push(Reverse(entry));
            }
        }
    }

    fn arguments_done(&self, id: Id) -> u32 {
        let mut at = 0;
        let done = &self.done;
        self.program.each_argument(self.value(id), |argument| {
            at = at.max(done[argument as usize]);
        });
        at
    }

    /// Those whose arguments are there by now may begin.
    fn open(&mut self) {
        while let Some(&Reverse((at, Reverse(height), id))) = self.queue.waiting.peek() {
            if at > self.now {
                return;
            }
            self.queue.waiting.pop();
            let entry = (height, Reverse(id));
            match divides(self.value(id)) {
                true => self.queue.dividing.push(entry),
                false => self.queue.open.push(entry),
            }
            if self.frees[id as usize] {
                self.queue.freeing.push(entry);
            }
        }
    }

    /// The one that begins next: of those that can the one on the longest way; where registers run out,
    /// rather one that needs no more of them.
    fn next(&mut self) -> Id {
        loop {
            self.open();
            let Self {
                queue, is_begun, ..
            } = self;
            clean(&mut queue.open, is_begun);
            clean(&mut queue.dividing, is_begun);
            if self.live >= self.registers
                && let Some(id) = self.frugal()
            {
                return id;
            }
            let queue = &mut self.queue;
            let division = queue.dividing.peek().filter(|_| self.divider <= self.now);
            let best = match division >= queue.open.peek() {
                true if division.is_some() => queue.dividing.pop(),
                _ => queue.open.pop(),
            };
            if let Some((_, Reverse(id))) = best {
                return id;
            }
            while let Some(&Reverse((_, _, id))) = queue.waiting.peek() {
                match self.is_begun[id as usize] {
                    true => queue.waiting.pop(),
                    false => break,
                };
            }
            let argument = queue.waiting.peek().map(|Reverse((at, ..))| *at);
            let divider = (!queue.dividing.is_empty()).then_some(self.divider);
            let next = argument.into_iter().chain(divider).min();
            (self.now, self.begun) = (next.unwrap_or(self.now + 1), 0);
        }
    }

    /// One that gives a register back, soon.
    fn frugal(&mut self) -> Option<Id> {
        let Self {
            queue, is_begun, ..
        } = self;
        clean(&mut queue.freeing, is_begun);
        if let Some((_, Reverse(id))) = queue.freeing.pop() {
            return Some(id);
        }
        while let Some(&Reverse((at, _, id))) = queue.coming.peek() {
            if !is_begun[id as usize] {
                return (at <= self.now + PATIENCE).then_some(id);
            }
            queue.coming.pop();
        }
        None
    }

    fn issue(&mut self, id: Id) {
        let value = self.value(id);
        let mut at = self.arguments_done(id).max(self.now);
        if divides(value) {
            at = at.max(self.divider);
            self.divider = at + DIVIDER;
        }
        if at > self.now {
            (self.now, self.begun) = (at, 0);
        }
        self.begun += 1;
        if self.begun == WIDTH {
            (self.now, self.begun) = (at + 1, 0);
        }
        self.done[id as usize] = at + latency(value);
        self.is_begun[id as usize] = true;
        self.live += usize::from(!is_leaf(value) && self.uses[id as usize] > 0);
        each_once(self.program, value, |argument| self.use_up(argument, id));
        self.order.push(id);
    }

    fn use_up(&mut self, argument: Id, user: Id) {
        let place = argument as usize;
        self.uses[place] -= 1;
        self.users[place] ^= user;
        if self.uses[place] == 0 && !is_leaf(self.value(argument)) {
            self.live -= 1;
        }
        if let Some(last) = self.note_last_user(argument) {
            let Some(at) = self.at[last as usize] else {
                return;
            };
            let height = self.height[last as usize];
            match at <= self.now {
                true => self.queue.freeing.push((height, Reverse(last))),
                false => self.queue.coming.push(Reverse((at, Reverse(height), last))),
            }
        }
    }

    /// The user that gives back the register of a value, if there is only one left.
    fn note_last_user(&mut self, id: Id) -> Option<Id> {
        if self.uses[id as usize] != 1 || is_leaf(self.value(id)) {
            return None;
        }
        let user = self.users[id as usize];
        let is_new = !std::mem::replace(&mut self.frees[user as usize], true);
        is_new.then_some(user)
    }

    fn result(self) -> Program {
        let mut places = vec![0; self.program.values.len()];
        for (place, &id) in (0..).zip(&self.order) {
            places[id as usize] = place;
        }
        let at = |id: Id| places[id as usize];
        let all = |ids: &Vec<Id>| ids.iter().map(|&id| at(id)).collect();
        let values = self.order.iter().map(|&id| self.value(id));
        Program {
            inputs: self.program.inputs,
            values: values.map(|value| value.with_arguments(at)).collect(),
            systems: self.program.systems.iter().map(all).collect(),
            outputs: all(&self.program.outputs),
        }
    }
}

/// Takes away what is begun from the front.
fn clean(queue: &mut BinaryHeap<Waiting>, is_begun: &[bool]) {
    while let Some((_, Reverse(id))) = queue.peek() {
        if !is_begun[*id as usize] {
            return;
        }
        queue.pop();
    }
}

/// Hands over the arguments of a value; those of an operation once.
fn each_once(program: &Program, value: Value, mut give: impl FnMut(Id)) {
    if let Value::Solve(_) = value {
        let mut arguments = vec![];
        program.each_argument(value, |argument| arguments.push(argument));
        arguments.sort_unstable();
        arguments.dedup();
        return arguments.into_iter().for_each(give);
    }
    let (mut known, mut count) = ([0; 4], 0);
    program.each_argument(value, |argument| {
        if !known[..count].contains(&argument) {
            known[count] = argument;
            count += 1;
            give(argument);
        }
    });
}
