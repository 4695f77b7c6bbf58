//! What a robot does by itself with what is due: it concerns no other robot until what it wants done is carried out.

use std::sync::Arc;
use std::time::Duration;

use gestalt_strategies::{Classify, Input, Mind, Observation, Output};

use super::parcel::Parcel;
use super::robot::Robot;
use super::turn::{Deed, Turn};
use crate::emulation::pupil::Pupil;
use crate::emulation::school::School;

impl Robot {
    /// Does its part of what is due for it now; it is up, or stands still.
    pub fn act(&mut self, now: Duration, turn: &Turn, up: bool, school: Option<&School>) -> Vec<Deed> {
        let mut deeds = Vec::new();
        match turn {
            // Another time may have been set since.
            Turn::Wakes if self.wake == Some(now) => {
                self.wake = None;
                if up {
                    self.tell(now, Input::Tick, &mut deeds);
                }
            }
            Turn::Looks(n) if self.looking && self.looks == *n => {
                self.look(now, school.filter(|_| up), up, &mut deeds);
            }
            Turn::Hears(Parcel::Said(envelope)) if self.may_read_later(envelope) => {
                self.unread.push((now, envelope.clone()));
            }
            Turn::Hears(parcel) if up => self.tell(now, parcel.opened(), &mut deeds),
            Turn::Has(boot, revision) if up && self.boot == *boot => {
                self.tell(now, Input::Remembered(*revision), &mut deeds)
            }
            Turn::Wakes | Turn::Looks(_) | Turn::Hears(_) | Turn::Has(..) => {}
        }
        deeds
    }

    /// Tells its mind that, once it was told all before.
    pub fn tell(&mut self, now: Duration, input: Input, deeds: &mut Vec<Deed>) {
        self.read();
        let Some(mind) = &mut self.mind else { return };
        let outputs = mind.handle(now, input);
        let wake = mind.next_wake();
        if self.wake != wake {
            self.wake = wake;
            deeds.extend(wake.map(|wake| Deed::Wakes(wake.max(now))));
        }
        deeds.reserve(outputs.len());
        for output in outputs {
            deeds.extend(self.done(now, output));
        }
    }

    /// What is left to be done of that, when it has done its own part.
    fn done(&mut self, now: Duration, output: Output) -> Option<Deed> {
        match output {
            Output::Opened(round) => {
                self.looking = true;
                self.looks += 1;
                let first = now + Duration::from_secs_f64(self.observer.period() * self.phase);
                Some(Deed::Looks(round, first, self.looks))
            }
            Output::Closed(_) => {
                self.looking = false;
                self.pupil.iter_mut().for_each(Pupil::rest);
                Some(Deed::Wants(output))
            }
            Output::Train(changes) => {
                self.pupil.as_mut()?.train_later(changes);
                None
            }
            Output::Remember { revision, changes } => {
                self.pupil.as_mut()?.remember(revision, changes);
                Some(Deed::Remembers(revision))
            }
            output => Some(Deed::Wants(output)),
        }
    }

    /// The next frame is there. One that stands still sees nothing of it.
    fn look(&mut self, now: Duration, school: Option<&School>, up: bool, deeds: &mut Vec<Deed>) {
        // A robot that learns does so before it looks again, not sooner, and only if its judgement is asked for: nobody asks before.
        let judges = self.mind.as_ref().is_some_and(Mind::votes);
        if let Some(school) = school.filter(|_| judges) {
            self.train(now, school, deeds);
        }
        let next = now + Duration::from_secs_f64(self.observer.period());
        if up && let Some(observation) = self.observer.frame(&mut self.rng) {
            if self.is_first && judges {
                deeds.extend(self.judgement(&observation).map(Deed::Judges));
            }
            self.tell(now, Input::Observed(observation), deeds);
        }
        self.is_first = false;
        deeds.push(Deed::LooksOn(next, self.looks));
    }

    /// What it makes of its first frame of what is shown, if it has not looked yet.
    pub fn first_frame(&mut self) -> Option<Vec<f64>> {
        let judges = self.mind.as_ref().is_some_and(Mind::votes);
        if !std::mem::take(&mut self.is_first) || !judges {
            return None;
        }
        let observation = self.observer.frame(&mut self.rng)?;
        self.judgement(&observation)
    }

    fn judgement(&self, observation: &Observation) -> Option<Vec<f64>> {
        let classifier: Option<Arc<dyn Classify>> = match &self.pupil {
            Some(pupil) => pupil.classifier().map(|classifier| classifier.clone() as Arc<dyn Classify>),
            None => self.observer.classifier(),
        };
        classifier?.probabilities(&observation.features).ok()
    }

    /// Its classifier follows its samples.
    pub fn train(&mut self, now: Duration, school: &School, deeds: &mut Vec<Deed>) {
        self.read();
        let Self { pupil, mind, .. } = self;
        let Some(pupil) = pupil else { return };
        if pupil.prepare(mind.as_ref(), school) {
            pupil.learn();
        }
        if let Some(classifier) = pupil.take_news() {
            let samples = mind.as_ref().and_then(Mind::training_set).map_or(0, |set| set.len());
            deeds.push(Deed::Learns(samples));
            self.tell(now, Input::Learned(classifier), deeds);
        }
    }
}
