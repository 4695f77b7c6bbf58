/* The mind of a Gestalt robot, for C and C++. Made by cbindgen of bindings/c; do not edit.
 *
 * Buffers are the caller's, before and after. No function keeps a pointer or throws, and none ends the process unless
 * memory runs out. Time is the number of nanoseconds since any fixed moment. bindings/README.md has more. */

#ifndef GESTALT_H
#define GESTALT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/*
 What `gestalt_mind_next_wake` gives when the mind wants no tick.
 */
#define GESTALT_NEVER UINT64_MAX

/*
 To all robots: a message's `to`. No neighbour has this number.
 */
#define GESTALT_TO_ALL UINT32_MAX

/*
 How a call ended. What is negative is an error, of which `gestalt_last_error` says more; the mind is unchanged by it, but by training.
 */
typedef enum {
  /*
   It is done.
   */
  GESTALT_STATUS_OK = 0,
  /*
   There is nothing to give: no message waits, no decision is held, nothing is to be trained.
   */
  GESTALT_STATUS_NOTHING = 1,
  /*
   The caller's buffer is too small: the lengths that were asked for are given, and nothing was taken.
   */
  GESTALT_STATUS_TOO_SMALL = 2,
  /*
   A pointer that is null and must not be, a number out of range, or text that is not UTF-8.
   */
  GESTALT_STATUS_ARGUMENT = -1,
  /*
   Settings that no mind can start with.
   */
  GESTALT_STATUS_SETTINGS = -2,
  /*
   Bytes or JSON from outside that are no message for this robot: count it, and go on.
   */
  GESTALT_STATUS_MESSAGE = -3,
  /*
   A model that cannot be read or used.
   */
  GESTALT_STATUS_MODEL = -4,
  /*
   Something in Gestalt is broken, and the mind with it: free it, and report what `gestalt_last_error` says.
   */
  GESTALT_STATUS_PANICKED = -5,
} GestaltStatus;

/*
 The mind of one robot.
 */
typedef struct GestaltMind GestaltMind;

/*
 A message for the host to carry, in buffers of the caller: `key`, `key_capacity`, `payload` and `payload_capacity` are the
 caller's, the rest is written.
 */
typedef struct {
  /*
   Where the key is written: `gestalt/<swarm>/…`, UTF-8 that ends with a zero byte.
   */
  char *key;
  /*
   How many bytes there is room for, the zero byte included.
   */
  size_t key_capacity;
  /*
   How long the key is, without the zero byte.
   */
  size_t key_length;
  /*
   Where the payload is written.
   */
  uint8_t *payload;
  /*
   How many bytes there is room for.
   */
  size_t payload_capacity;
  /*
   How long the payload is.
   */
  size_t payload_length;
  /*
   The neighbour that it is for, or `GESTALT_TO_ALL`.
   */
  uint32_t to;
  /*
   Whether the payload is JSON; else it is an envelope, which `gestalt_mind_received` also takes without a key.
   */
  bool json;
} GestaltMessage;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Starts a mind. `settings` is JSON, such as
 `{"robot": 1, "boot": 1, "seed": 42, "swarm": "demo", "vocabulary": ["left", "right"]}`; `bindings/README.md` lists all keys.
 Writes the mind to `*mind`, or null if it cannot start. Free it with `gestalt_mind_free`.

 # Safety
 `settings` is null or ends with a zero byte; `mind` is null or has room for a pointer.
 */
GestaltStatus gestalt_mind_new(const char *settings,
                               GestaltMind **mind);

/*
 Ends a mind; null is none.

 # Safety
 `mind` is null, or comes from `gestalt_mind_new`, was not freed before, and is used by no other thread.
 */
void gestalt_mind_free(GestaltMind *mind);

/*
 Reads a model file that `gestalt train` wrote. From now on the mind observes feature vectors. A mind that learns takes its
 model before all else.

 # Safety
 `mind` as everywhere; `path` is null or ends with a zero byte.
 */
GestaltStatus gestalt_mind_load_model(GestaltMind *mind,
                                      uint64_t now_ns,
                                      const char *path);

/*
 A frame showed a hand: `values` is its feature vector or, without a model, the probability of each gesture of the
 vocabulary. `quality` is how far that is to be trusted, 0 to 1.

 # Safety
 `mind` as everywhere; `values` points to `length` numbers.
 */
GestaltStatus gestalt_mind_observe(GestaltMind *mind,
                                   uint64_t now_ns,
                                   const float *values,
                                   size_t length,
                                   float quality);

/*
 A message arrived, with the key that `gestalt_mind_next_message` gave it. For an envelope `key` may be null: it names its
 author itself, and what was for another robot is for the host to leave out.

 # Safety
 `mind` as everywhere; `key` is null or ends with a zero byte; `payload` points to `length` bytes.
 */
GestaltStatus gestalt_mind_received(GestaltMind *mind,
                                    uint64_t now_ns,
                                    const char *key,
                                    const uint8_t *payload,
                                    size_t length);

/*
 An instructor says something, as JSON: `{"say": "was", "round": {…}, "class": "left"}`. `at` is a time that is the same at
 every robot, and grows with every word of that instructor.

 # Safety
 `mind` as everywhere; `instructor` and `word` are null or end with a zero byte.
 */
GestaltStatus gestalt_mind_instructed(GestaltMind *mind,
                                      uint64_t now_ns,
                                      const char *instructor,
                                      uint64_t at,
                                      const char *word);

/*
 A gesture is being shown: opens a round, unless one is open or was opened just now.

 # Safety
 `mind` as everywhere.
 */
GestaltStatus gestalt_mind_open(GestaltMind *mind, uint64_t now_ns);

/*
 Time has passed: owed at `gestalt_mind_next_wake`, more do no harm.

 # Safety
 `mind` as everywhere.
 */
GestaltStatus gestalt_mind_tick(GestaltMind *mind, uint64_t now_ns);

/*
 Whether the camera shows nothing at all: a blind robot takes part, and need not be waited for.

 # Safety
 `mind` as everywhere.
 */
GestaltStatus gestalt_mind_set_blind(GestaltMind *mind, uint64_t now_ns, bool blind);

/*
 The robots that are alive now.

 # Safety
 `mind` as everywhere; `robots` points to `length` numbers.
 */
GestaltStatus gestalt_mind_set_alive(GestaltMind *mind,
                                     uint64_t now_ns,
                                     const uint32_t *robots,
                                     size_t length);

/*
 The robots that this one can hear directly now, without itself: with them it compares what it knows.

 # Safety
 `mind` as everywhere; `robots` points to `length` numbers.
 */
GestaltStatus gestalt_mind_set_neighbours(GestaltMind *mind,
                                          uint64_t now_ns,
                                          const uint32_t *robots,
                                          size_t length);

/*
 When the mind wants its next tick, if nothing else comes before; `GESTALT_NEVER` if it wants none, or is null.

 # Safety
 `mind` as everywhere.
 */
uint64_t gestalt_mind_next_wake(GestaltMind *mind);

/*
 Whether this robot takes part in a round now: it should look. `GESTALT_STATUS_NOTHING` if not.

 # Safety
 `mind` as everywhere.
 */
GestaltStatus gestalt_mind_is_open(GestaltMind *mind);

/*
 Takes the next message to carry. `GESTALT_STATUS_NOTHING` if none waits; `GESTALT_STATUS_TOO_SMALL` if a buffer is too
 small: then both lengths and the rest are written, and the message waits.

 # Safety
 `mind` as everywhere; `message` is null or points to one whose buffers have room for as many bytes as it says.
 */
GestaltStatus gestalt_mind_next_message(GestaltMind *mind,
                                        GestaltMessage *message);

/*
 Writes the decision held for the newest round as JSON that ends with a zero byte. `*length` becomes its length, without the
 zero. `GESTALT_STATUS_NOTHING` before a decision; `GESTALT_STATUS_TOO_SMALL` for a buffer that has no room for it.

 # Safety
 `mind` as everywhere; `buffer` is null or has room for `capacity` bytes; `length` is null or has room for a number.
 */
GestaltStatus gestalt_mind_decision(GestaltMind *mind,
                                    char *buffer,
                                    size_t capacity,
                                    size_t *length);

/*
 Writes what is worth knowing of the mind as JSON, as `gestalt_mind_decision` writes a decision: its round, what it has
 learned, and what it refused so far, by cause.

 # Safety
 As of `gestalt_mind_decision`.
 */
GestaltStatus gestalt_mind_status(GestaltMind *mind,
                                  char *buffer,
                                  size_t capacity,
                                  size_t *length);

/*
 Makes the classifier follow what was learned since the last time. `GESTALT_STATUS_NOTHING` if there is nothing to
 follow. It may take seconds: call it where nothing waits. After `GESTALT_STATUS_MODEL` it follows all but what could not
 be trained on.

 # Safety
 `mind` as everywhere.
 */
GestaltStatus gestalt_mind_train(GestaltMind *mind,
                                 uint64_t now_ns);

/*
 Writes what was wrong with this thread's latest call that failed, as UTF-8 that ends with a zero byte, cut to
 `capacity`. Gives its whole length in bytes, without the zero; 0 before the first error.

 # Safety
 `buffer` is null, or has room for `capacity` bytes.
 */
size_t gestalt_last_error(char *buffer, size_t capacity);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* GESTALT_H */
