// The messages of i2ris in shared memory, byte for byte as in src/ipc/payload, where fields are explained.
// Written by `cargo run -p i2ris-record --example cpp_header`; a test compares and compiles it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace i2ris {

// The second word of the file `ready`. A controller with a different one is from a different release.
constexpr int INTERFACE_VERSION = 7;
// Versions of iceoryx2 refuse each other.
constexpr const char* ICEORYX2_VERSION = "0.10.0";

struct SpanSummary {
    std::uint64_t p50_ns;
    std::uint64_t p90_ns;
    std::uint64_t p99_ns;
    std::uint64_t p999_ns;
    std::uint64_t max_ns;
};

struct ServoJp {
    static constexpr const char* IOX2_TYPE_NAME = "I2risServoJpV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t client_id;
    std::uint64_t deadline_ns;
    double position[3];
    std::uint32_t count;
    std::uint32_t flags;
};
static_assert(sizeof(ServoJp) == 64);
static_assert(offsetof(ServoJp, sequence) == 0);
static_assert(offsetof(ServoJp, stamp_ns) == 8);
static_assert(offsetof(ServoJp, client_id) == 16);
static_assert(offsetof(ServoJp, deadline_ns) == 24);
static_assert(offsetof(ServoJp, position) == 32);
static_assert(offsetof(ServoJp, count) == 56);
static_assert(offsetof(ServoJp, flags) == 60);

struct ServoActuator {
    static constexpr const char* IOX2_TYPE_NAME = "I2risServoActuatorV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t client_id;
    std::uint64_t deadline_ns;
    std::int32_t position_counts[2];
    std::uint32_t count;
    std::uint32_t flags;
};
static_assert(sizeof(ServoActuator) == 48);
static_assert(offsetof(ServoActuator, sequence) == 0);
static_assert(offsetof(ServoActuator, stamp_ns) == 8);
static_assert(offsetof(ServoActuator, client_id) == 16);
static_assert(offsetof(ServoActuator, deadline_ns) == 24);
static_assert(offsetof(ServoActuator, position_counts) == 32);
static_assert(offsetof(ServoActuator, count) == 40);
static_assert(offsetof(ServoActuator, flags) == 44);

struct JointState {
    static constexpr const char* IOX2_TYPE_NAME = "I2risJointStateV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    double position[3];
    double velocity[3];
    double deviation[3];
    std::uint8_t model_id[32];
    std::uint32_t count;
    std::uint32_t flags;
};
static_assert(sizeof(JointState) == 136);
static_assert(offsetof(JointState, sequence) == 0);
static_assert(offsetof(JointState, stamp_ns) == 8);
static_assert(offsetof(JointState, boot_id) == 16);
static_assert(offsetof(JointState, position) == 24);
static_assert(offsetof(JointState, velocity) == 48);
static_assert(offsetof(JointState, deviation) == 72);
static_assert(offsetof(JointState, model_id) == 96);
static_assert(offsetof(JointState, count) == 128);
static_assert(offsetof(JointState, flags) == 132);

struct ActuatorState {
    static constexpr const char* IOX2_TYPE_NAME = "I2risActuatorStateV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint64_t measured_stamp_ns[2];
    std::uint64_t written_stamp_ns[2];
    std::uint64_t command_stamp_ns[2];
    std::uint64_t command_sequence[2];
    std::uint64_t exchanges[2];
    std::int32_t measured_counts[2];
    std::int32_t setpoint_counts[2];
    std::int32_t written_counts[2];
    std::int32_t current_ma[2];
    std::uint16_t statusword[2];
    std::uint16_t error_code[2];
    std::uint8_t phase[2];
    std::uint8_t reserved[2];
    std::uint32_t count;
};
static_assert(sizeof(ActuatorState) == 152);
static_assert(offsetof(ActuatorState, sequence) == 0);
static_assert(offsetof(ActuatorState, stamp_ns) == 8);
static_assert(offsetof(ActuatorState, boot_id) == 16);
static_assert(offsetof(ActuatorState, measured_stamp_ns) == 24);
static_assert(offsetof(ActuatorState, written_stamp_ns) == 40);
static_assert(offsetof(ActuatorState, command_stamp_ns) == 56);
static_assert(offsetof(ActuatorState, command_sequence) == 72);
static_assert(offsetof(ActuatorState, exchanges) == 88);
static_assert(offsetof(ActuatorState, measured_counts) == 104);
static_assert(offsetof(ActuatorState, setpoint_counts) == 112);
static_assert(offsetof(ActuatorState, written_counts) == 120);
static_assert(offsetof(ActuatorState, current_ma) == 128);
static_assert(offsetof(ActuatorState, statusword) == 136);
static_assert(offsetof(ActuatorState, error_code) == 140);
static_assert(offsetof(ActuatorState, phase) == 144);
static_assert(offsetof(ActuatorState, reserved) == 146);
static_assert(offsetof(ActuatorState, count) == 148);

struct OperatingStateMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risOperatingStateV2";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint64_t since_ns;
    std::uint64_t lease_client_id;
    std::uint64_t accepted;
    std::uint64_t refused;
    std::uint64_t stale_stops;
    std::uint32_t state;
    std::uint32_t fault;
    std::uint32_t last_refusal;
    std::uint32_t flags;
    std::uint64_t refused_client_id[8];
    std::uint64_t refused_commands[8];
    std::uint32_t refused_reason[8];
};
static_assert(sizeof(OperatingStateMsg) == 240);
static_assert(offsetof(OperatingStateMsg, sequence) == 0);
static_assert(offsetof(OperatingStateMsg, stamp_ns) == 8);
static_assert(offsetof(OperatingStateMsg, boot_id) == 16);
static_assert(offsetof(OperatingStateMsg, since_ns) == 24);
static_assert(offsetof(OperatingStateMsg, lease_client_id) == 32);
static_assert(offsetof(OperatingStateMsg, accepted) == 40);
static_assert(offsetof(OperatingStateMsg, refused) == 48);
static_assert(offsetof(OperatingStateMsg, stale_stops) == 56);
static_assert(offsetof(OperatingStateMsg, state) == 64);
static_assert(offsetof(OperatingStateMsg, fault) == 68);
static_assert(offsetof(OperatingStateMsg, last_refusal) == 72);
static_assert(offsetof(OperatingStateMsg, flags) == 76);
static_assert(offsetof(OperatingStateMsg, refused_client_id) == 80);
static_assert(offsetof(OperatingStateMsg, refused_commands) == 144);
static_assert(offsetof(OperatingStateMsg, refused_reason) == 208);

struct Health {
    static constexpr const char* IOX2_TYPE_NAME = "I2risHealthV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint64_t ipc_failures;
    std::uint64_t lost_events;
    std::uint64_t lost_reports;
    std::uint64_t lost_records;
    std::uint64_t lost_replies;
    std::uint64_t timeouts[2];
    std::uint64_t crc_errors[2];
    std::uint64_t resynchronisations[2];
    std::uint64_t retries[2];
};
static_assert(sizeof(Health) == 128);
static_assert(offsetof(Health, sequence) == 0);
static_assert(offsetof(Health, stamp_ns) == 8);
static_assert(offsetof(Health, boot_id) == 16);
static_assert(offsetof(Health, ipc_failures) == 24);
static_assert(offsetof(Health, lost_events) == 32);
static_assert(offsetof(Health, lost_reports) == 40);
static_assert(offsetof(Health, lost_records) == 48);
static_assert(offsetof(Health, lost_replies) == 56);
static_assert(offsetof(Health, timeouts) == 64);
static_assert(offsetof(Health, crc_errors) == 80);
static_assert(offsetof(Health, resynchronisations) == 96);
static_assert(offsetof(Health, retries) == 112);

struct AdaptationMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risAdaptationV2";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint8_t model_id[32];
    double estimate[14];
    double deviation[14];
    double applied[14];
    double budget_used[14];
    double total_used;
    double calibrated_error;
    double adapted_error;
    std::uint64_t frames_used;
    std::uint64_t frames_refused;
    std::uint64_t frames_paused;
    std::uint64_t frames_dropped[6];
    std::uint32_t taken_back;
    std::uint32_t method;
    std::uint32_t pauses;
    std::uint32_t excited;
    std::uint32_t flags;
    std::uint32_t reserved;
};
static_assert(sizeof(AdaptationMsg) == 624);
static_assert(offsetof(AdaptationMsg, sequence) == 0);
static_assert(offsetof(AdaptationMsg, stamp_ns) == 8);
static_assert(offsetof(AdaptationMsg, boot_id) == 16);
static_assert(offsetof(AdaptationMsg, model_id) == 24);
static_assert(offsetof(AdaptationMsg, estimate) == 56);
static_assert(offsetof(AdaptationMsg, deviation) == 168);
static_assert(offsetof(AdaptationMsg, applied) == 280);
static_assert(offsetof(AdaptationMsg, budget_used) == 392);
static_assert(offsetof(AdaptationMsg, total_used) == 504);
static_assert(offsetof(AdaptationMsg, calibrated_error) == 512);
static_assert(offsetof(AdaptationMsg, adapted_error) == 520);
static_assert(offsetof(AdaptationMsg, frames_used) == 528);
static_assert(offsetof(AdaptationMsg, frames_refused) == 536);
static_assert(offsetof(AdaptationMsg, frames_paused) == 544);
static_assert(offsetof(AdaptationMsg, frames_dropped) == 552);
static_assert(offsetof(AdaptationMsg, taken_back) == 600);
static_assert(offsetof(AdaptationMsg, method) == 604);
static_assert(offsetof(AdaptationMsg, pauses) == 608);
static_assert(offsetof(AdaptationMsg, excited) == 612);
static_assert(offsetof(AdaptationMsg, flags) == 616);
static_assert(offsetof(AdaptationMsg, reserved) == 620);

struct VirtualFixturesMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risVirtualFixturesV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint32_t active;
    std::uint32_t limited_by;
    std::uint32_t kind[8];
    double values[136];
    std::uint8_t name[192];
};
static_assert(sizeof(VirtualFixturesMsg) == 1344);
static_assert(offsetof(VirtualFixturesMsg, sequence) == 0);
static_assert(offsetof(VirtualFixturesMsg, stamp_ns) == 8);
static_assert(offsetof(VirtualFixturesMsg, boot_id) == 16);
static_assert(offsetof(VirtualFixturesMsg, active) == 24);
static_assert(offsetof(VirtualFixturesMsg, limited_by) == 28);
static_assert(offsetof(VirtualFixturesMsg, kind) == 32);
static_assert(offsetof(VirtualFixturesMsg, values) == 64);
static_assert(offsetof(VirtualFixturesMsg, name) == 1152);

struct EventMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risEventV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint8_t text[232];
};
static_assert(sizeof(EventMsg) == 256);
static_assert(offsetof(EventMsg, sequence) == 0);
static_assert(offsetof(EventMsg, stamp_ns) == 8);
static_assert(offsetof(EventMsg, boot_id) == 16);
static_assert(offsetof(EventMsg, text) == 24);

struct ReasonMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risReasonV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint64_t client_id;
    double measured;
    double limit;
    std::uint32_t kind;
    std::uint32_t number;
    std::uint32_t quantity;
    std::uint32_t motor;
    std::uint32_t flags;
    std::uint32_t reserved;
    std::uint8_t text[192];
    std::uint8_t advice[128];
};
static_assert(sizeof(ReasonMsg) == 392);
static_assert(offsetof(ReasonMsg, sequence) == 0);
static_assert(offsetof(ReasonMsg, stamp_ns) == 8);
static_assert(offsetof(ReasonMsg, boot_id) == 16);
static_assert(offsetof(ReasonMsg, client_id) == 24);
static_assert(offsetof(ReasonMsg, measured) == 32);
static_assert(offsetof(ReasonMsg, limit) == 40);
static_assert(offsetof(ReasonMsg, kind) == 48);
static_assert(offsetof(ReasonMsg, number) == 52);
static_assert(offsetof(ReasonMsg, quantity) == 56);
static_assert(offsetof(ReasonMsg, motor) == 60);
static_assert(offsetof(ReasonMsg, flags) == 64);
static_assert(offsetof(ReasonMsg, reserved) == 68);
static_assert(offsetof(ReasonMsg, text) == 72);
static_assert(offsetof(ReasonMsg, advice) == 264);

struct PeriodStatistics {
    static constexpr const char* IOX2_TYPE_NAME = "I2risPeriodStatisticsV2";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t boot_id;
    std::uint64_t window_ns;
    std::uint64_t period_ns;
    std::uint64_t ticks;
    std::uint64_t missed;
    std::uint64_t total_ticks;
    std::uint64_t total_missed;
    SpanSummary period;
    SpanSummary lateness;
    SpanSummary compute;
    double line_setpoints_hz;
    std::uint64_t line_exchange_ns;
    std::uint64_t line_stop_ns;
    std::uint64_t line_stale_ns;
    std::uint32_t priority;
    std::uint32_t cpu;
    std::uint32_t memory_locked;
    std::uint32_t reserved;
};
static_assert(sizeof(PeriodStatistics) == 240);
static_assert(offsetof(PeriodStatistics, sequence) == 0);
static_assert(offsetof(PeriodStatistics, stamp_ns) == 8);
static_assert(offsetof(PeriodStatistics, boot_id) == 16);
static_assert(offsetof(PeriodStatistics, window_ns) == 24);
static_assert(offsetof(PeriodStatistics, period_ns) == 32);
static_assert(offsetof(PeriodStatistics, ticks) == 40);
static_assert(offsetof(PeriodStatistics, missed) == 48);
static_assert(offsetof(PeriodStatistics, total_ticks) == 56);
static_assert(offsetof(PeriodStatistics, total_missed) == 64);
static_assert(offsetof(PeriodStatistics, period) == 72);
static_assert(offsetof(PeriodStatistics, lateness) == 112);
static_assert(offsetof(PeriodStatistics, compute) == 152);
static_assert(offsetof(PeriodStatistics, line_setpoints_hz) == 192);
static_assert(offsetof(PeriodStatistics, line_exchange_ns) == 200);
static_assert(offsetof(PeriodStatistics, line_stop_ns) == 208);
static_assert(offsetof(PeriodStatistics, line_stale_ns) == 216);
static_assert(offsetof(PeriodStatistics, priority) == 224);
static_assert(offsetof(PeriodStatistics, cpu) == 228);
static_assert(offsetof(PeriodStatistics, memory_locked) == 232);
static_assert(offsetof(PeriodStatistics, reserved) == 236);

struct ExternalPosition {
    static constexpr const char* IOX2_TYPE_NAME = "I2risExternalPositionV2";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    double position[3];
    double deviation[3];
    double quality;
    std::uint32_t count;
    std::uint32_t flags;
};
static_assert(sizeof(ExternalPosition) == 80);
static_assert(offsetof(ExternalPosition, sequence) == 0);
static_assert(offsetof(ExternalPosition, stamp_ns) == 8);
static_assert(offsetof(ExternalPosition, position) == 16);
static_assert(offsetof(ExternalPosition, deviation) == 40);
static_assert(offsetof(ExternalPosition, quality) == 64);
static_assert(offsetof(ExternalPosition, count) == 72);
static_assert(offsetof(ExternalPosition, flags) == 76);

struct ReachTarget {
    static constexpr const char* IOX2_TYPE_NAME = "I2risReachTargetV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t client_id;
    std::uint64_t shown_ns;
    std::uint64_t hold_ns;
    std::uint64_t held_ns;
    double position[3];
    double tolerance;
    std::uint32_t number;
    std::uint32_t total;
    std::uint32_t count;
    std::uint32_t flags;
};
static_assert(sizeof(ReachTarget) == 96);
static_assert(offsetof(ReachTarget, sequence) == 0);
static_assert(offsetof(ReachTarget, stamp_ns) == 8);
static_assert(offsetof(ReachTarget, client_id) == 16);
static_assert(offsetof(ReachTarget, shown_ns) == 24);
static_assert(offsetof(ReachTarget, hold_ns) == 32);
static_assert(offsetof(ReachTarget, held_ns) == 40);
static_assert(offsetof(ReachTarget, position) == 48);
static_assert(offsetof(ReachTarget, tolerance) == 72);
static_assert(offsetof(ReachTarget, number) == 80);
static_assert(offsetof(ReachTarget, total) == 84);
static_assert(offsetof(ReachTarget, count) == 88);
static_assert(offsetof(ReachTarget, flags) == 92);

struct TeleopMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risTeleopV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t client_id;
    double view[4];
    double push[2];
    double scale;
    std::uint64_t event_ns;
    std::uint64_t command_sequence;
    std::uint64_t mark_ns;
    std::uint32_t mode;
    std::uint32_t flags;
    std::uint8_t why_open[128];
};
static_assert(sizeof(TeleopMsg) == 240);
static_assert(offsetof(TeleopMsg, sequence) == 0);
static_assert(offsetof(TeleopMsg, stamp_ns) == 8);
static_assert(offsetof(TeleopMsg, client_id) == 16);
static_assert(offsetof(TeleopMsg, view) == 24);
static_assert(offsetof(TeleopMsg, push) == 56);
static_assert(offsetof(TeleopMsg, scale) == 72);
static_assert(offsetof(TeleopMsg, event_ns) == 80);
static_assert(offsetof(TeleopMsg, command_sequence) == 88);
static_assert(offsetof(TeleopMsg, mark_ns) == 96);
static_assert(offsetof(TeleopMsg, mode) == 104);
static_assert(offsetof(TeleopMsg, flags) == 108);
static_assert(offsetof(TeleopMsg, why_open) == 112);

struct TrialMsg {
    static constexpr const char* IOX2_TYPE_NAME = "I2risTrialV1";
    std::uint64_t sequence;
    std::uint64_t stamp_ns;
    std::uint64_t client_id;
    std::uint64_t started_ns;
    std::uint64_t mark_ns;
    std::uint32_t mark_number;
    std::uint32_t flags;
    std::uint8_t trial[64];
    std::uint8_t mark[64];
};
static_assert(sizeof(TrialMsg) == 176);
static_assert(offsetof(TrialMsg, sequence) == 0);
static_assert(offsetof(TrialMsg, stamp_ns) == 8);
static_assert(offsetof(TrialMsg, client_id) == 16);
static_assert(offsetof(TrialMsg, started_ns) == 24);
static_assert(offsetof(TrialMsg, mark_ns) == 32);
static_assert(offsetof(TrialMsg, mark_number) == 40);
static_assert(offsetof(TrialMsg, flags) == 44);
static_assert(offsetof(TrialMsg, trial) == 48);
static_assert(offsetof(TrialMsg, mark) == 112);

struct ModelRequest {
    static constexpr const char* IOX2_TYPE_NAME = "I2risModelRequestV2";
    std::uint64_t client_id;
    std::uint64_t stamp_ns;
    std::uint64_t valid_ns;
    std::uint32_t action;
    std::uint32_t flags;
    std::uint8_t model_id[32];
    std::uint8_t path[1024];
};
static_assert(sizeof(ModelRequest) == 1088);
static_assert(offsetof(ModelRequest, client_id) == 0);
static_assert(offsetof(ModelRequest, stamp_ns) == 8);
static_assert(offsetof(ModelRequest, valid_ns) == 16);
static_assert(offsetof(ModelRequest, action) == 24);
static_assert(offsetof(ModelRequest, flags) == 28);
static_assert(offsetof(ModelRequest, model_id) == 32);
static_assert(offsetof(ModelRequest, path) == 64);

struct ModelSlot {
    static constexpr const char* IOX2_TYPE_NAME = "I2risModelSlotV1";
    double training_rms[3];
    double held_out_rms[3];
    std::uint8_t model_id[32];
    std::uint8_t family[32];
    std::uint8_t file[120];
    std::uint32_t outputs;
    std::uint32_t flags;
};
static_assert(sizeof(ModelSlot) == 240);
static_assert(offsetof(ModelSlot, training_rms) == 0);
static_assert(offsetof(ModelSlot, held_out_rms) == 24);
static_assert(offsetof(ModelSlot, model_id) == 48);
static_assert(offsetof(ModelSlot, family) == 80);
static_assert(offsetof(ModelSlot, file) == 112);
static_assert(offsetof(ModelSlot, outputs) == 232);
static_assert(offsetof(ModelSlot, flags) == 236);

struct ModelDifference {
    static constexpr const char* IOX2_TYPE_NAME = "I2risModelDifferenceV1";
    double present_counts[2];
    double largest_counts[2];
    double largest_at_counts[2];
    double unreached;
    std::uint32_t valid;
    std::uint32_t reserved;
};
static_assert(sizeof(ModelDifference) == 64);
static_assert(offsetof(ModelDifference, present_counts) == 0);
static_assert(offsetof(ModelDifference, largest_counts) == 16);
static_assert(offsetof(ModelDifference, largest_at_counts) == 32);
static_assert(offsetof(ModelDifference, unreached) == 48);
static_assert(offsetof(ModelDifference, valid) == 56);
static_assert(offsetof(ModelDifference, reserved) == 60);

struct BlackBoxRequest {
    static constexpr const char* IOX2_TYPE_NAME = "I2risBlackBoxRequestV1";
    std::uint64_t client_id;
};
static_assert(sizeof(BlackBoxRequest) == 8);
static_assert(offsetof(BlackBoxRequest, client_id) == 0);

struct BlackBoxReply {
    static constexpr const char* IOX2_TYPE_NAME = "I2risBlackBoxReplyV1";
    std::uint64_t ticks;
    std::uint8_t text[1024];
};
static_assert(sizeof(BlackBoxReply) == 1032);
static_assert(offsetof(BlackBoxReply, ticks) == 0);
static_assert(offsetof(BlackBoxReply, text) == 8);

struct StateCommandRequest {
    static constexpr const char* IOX2_TYPE_NAME = "I2risStateCommandV2";
    std::uint64_t client_id;
    std::uint64_t stamp_ns;
    std::uint64_t valid_ns;
    std::uint32_t command;
    std::uint32_t reserved;
};
static_assert(sizeof(StateCommandRequest) == 32);
static_assert(offsetof(StateCommandRequest, client_id) == 0);
static_assert(offsetof(StateCommandRequest, stamp_ns) == 8);
static_assert(offsetof(StateCommandRequest, valid_ns) == 16);
static_assert(offsetof(StateCommandRequest, command) == 24);
static_assert(offsetof(StateCommandRequest, reserved) == 28);

struct StateCommandReply {
    static constexpr const char* IOX2_TYPE_NAME = "I2risStateCommandReplyV2";
    std::uint32_t refusal;
    std::uint32_t state;
    double measured;
    double limit;
    std::uint32_t quantity;
    std::uint32_t motor;
    std::uint32_t flags;
    std::uint32_t reserved;
};
static_assert(sizeof(StateCommandReply) == 40);
static_assert(offsetof(StateCommandReply, refusal) == 0);
static_assert(offsetof(StateCommandReply, state) == 4);
static_assert(offsetof(StateCommandReply, measured) == 8);
static_assert(offsetof(StateCommandReply, limit) == 16);
static_assert(offsetof(StateCommandReply, quantity) == 24);
static_assert(offsetof(StateCommandReply, motor) == 28);
static_assert(offsetof(StateCommandReply, flags) == 32);
static_assert(offsetof(StateCommandReply, reserved) == 36);

struct MoveRequest {
    static constexpr const char* IOX2_TYPE_NAME = "I2risMoveRequestV2";
    std::uint64_t client_id;
    std::uint64_t stamp_ns;
    std::uint64_t valid_ns;
    double position[3];
    std::uint32_t count;
    std::uint32_t flags;
};
static_assert(sizeof(MoveRequest) == 56);
static_assert(offsetof(MoveRequest, client_id) == 0);
static_assert(offsetof(MoveRequest, stamp_ns) == 8);
static_assert(offsetof(MoveRequest, valid_ns) == 16);
static_assert(offsetof(MoveRequest, position) == 24);
static_assert(offsetof(MoveRequest, count) == 48);
static_assert(offsetof(MoveRequest, flags) == 52);

struct VirtualFixtureRequest {
    static constexpr const char* IOX2_TYPE_NAME = "I2risVirtualFixtureRequestV2";
    std::uint64_t client_id;
    std::uint64_t stamp_ns;
    std::uint64_t valid_ns;
    std::uint32_t action;
    std::uint32_t kind;
    double values[4];
};
static_assert(sizeof(VirtualFixtureRequest) == 64);
static_assert(offsetof(VirtualFixtureRequest, client_id) == 0);
static_assert(offsetof(VirtualFixtureRequest, stamp_ns) == 8);
static_assert(offsetof(VirtualFixtureRequest, valid_ns) == 16);
static_assert(offsetof(VirtualFixtureRequest, action) == 24);
static_assert(offsetof(VirtualFixtureRequest, kind) == 28);
static_assert(offsetof(VirtualFixtureRequest, values) == 32);

struct VersionRequest {
    static constexpr const char* IOX2_TYPE_NAME = "I2risVersionRequestV1";
    std::uint64_t reserved;
};
static_assert(sizeof(VersionRequest) == 8);
static_assert(offsetof(VersionRequest, reserved) == 0);

struct Version {
    static constexpr const char* IOX2_TYPE_NAME = "I2risVersionV2";
    std::uint64_t boot_id;
    std::uint32_t pid;
    std::uint32_t interface;
    std::uint16_t software[3];
    std::uint8_t shape[2];
    std::uint8_t model_id[32];
    std::uint8_t output_names[48];
    double velocity_counts_s;
    double acceleration_counts_s2;
    std::int32_t position_min_counts[2];
    std::int32_t position_max_counts[2];
    std::uint8_t robot_id[64];
};
static_assert(sizeof(Version) == 200);
static_assert(offsetof(Version, boot_id) == 0);
static_assert(offsetof(Version, pid) == 8);
static_assert(offsetof(Version, interface) == 12);
static_assert(offsetof(Version, software) == 16);
static_assert(offsetof(Version, shape) == 22);
static_assert(offsetof(Version, model_id) == 24);
static_assert(offsetof(Version, output_names) == 56);
static_assert(offsetof(Version, velocity_counts_s) == 104);
static_assert(offsetof(Version, acceleration_counts_s2) == 112);
static_assert(offsetof(Version, position_min_counts) == 120);
static_assert(offsetof(Version, position_max_counts) == 128);
static_assert(offsetof(Version, robot_id) == 136);

} // namespace i2ris
