// A complete client in C++, on the C++ binding of iceoryx2 0.10.
//
//     client i2ris
//
// Prints the measured angles, then holds the lease for one second by repeating the present setpoint.
// Nothing moves. The robot must be ENABLED and have a model.

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include "i2ris_payload.hpp"
#include "iox2/iceoryx2.hpp"

namespace {

using Service = iox2::Node<iox2::ServiceType::Ipc>;

// CLOCK_MONOTONIC, the clock of all stamps.
std::uint64_t now_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U
           + static_cast<std::uint64_t>(now.tv_nsec);
}

iox2::bb::Path path(const std::string& text) {
    using Text = iox2::bb::StaticString<iox2::bb::platform::IOX2_MAX_PATH_LENGTH>;
    return iox2::bb::Path::create(*Text::from_utf8_null_terminated_unchecked(text.c_str())).value();
}

iox2::bb::FileName file_name(const std::string& text) {
    using Text = iox2::bb::StaticString<iox2::bb::platform::IOX2_MAX_FILENAME_LENGTH>;
    return iox2::bb::FileName::create(*Text::from_utf8_null_terminated_unchecked(text.c_str())).value();
}

// Whether a controller locks the second byte of the file: only then is `ready` valid.
bool is_served(const std::string& folder) {
    const int lock = open((folder + "/lock").c_str(), O_RDONLY | O_CLOEXEC);
    if (lock < 0) {
        return false;
    }
    struct flock probe {};
    probe.l_type = F_WRLCK;
    probe.l_whence = SEEK_SET;
    probe.l_start = 1;
    probe.l_len = 1;
    const bool answered = fcntl(lock, F_OFD_GETLK, &probe) == 0;
    close(lock);
    return answered && probe.l_type != F_UNLCK;
}

// A node in the shared memory of the controller that serves the domain now.
Service connect(const std::string& domain) {
    const std::string name = "i2ris-" + std::to_string(geteuid()) + "-" + domain;
    const std::string folder = "/dev/shm/" + name;
    std::ifstream ready(folder + "/ready");
    std::string boot;
    int interface_version = 0;
    if (!is_served(folder) || !(ready >> boot >> interface_version)) {
        std::cerr << "no controller serves domain " << domain << "\n";
        std::exit(3);
    }
    if (interface_version != i2ris::INTERFACE_VERSION) {
        std::cerr << "the controller of domain " << domain << " has interface version " << interface_version
                  << ", this client " << i2ris::INTERFACE_VERSION << ": use the same release for both\n";
        std::exit(3);
    }
    auto config = iox2::Config::global_config().to_owned();
    config.global().set_root_path(path(folder + "/" + boot));
    config.global().set_prefix(file_name(name + "_" + boot + "_"));
    config.global().node().set_cleanup_dead_nodes_on_creation(false);
    config.global().node().set_cleanup_dead_nodes_on_destruction(false);
    config.global().service().set_cleanup_dead_nodes_on_open(false);
    return iox2::NodeBuilder().config(config).create<iox2::ServiceType::Ipc>().value();
}

template <typename T>
auto stream(const Service& node, const char* name) {
    auto service = iox2::ServiceName::create(name).value();
    return node.service_builder(service).template publish_subscribe<T>().open().value();
}

// The newest message; waits one second for the first one.
template <typename Subscriber>
std::optional<i2ris::JointState> newest(Subscriber& subscriber) {
    std::optional<i2ris::JointState> message;
    for (int attempt = 0; attempt < 1000 && !message; ++attempt) {
        while (auto sample = subscriber.receive().value()) {
            message = sample->payload();
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return message;
}

} // namespace

int main(int argc, char** argv) {
    const auto node = connect(argc > 1 ? argv[1] : "i2ris");
    auto measured_service = stream<i2ris::JointState>(node, "i2ris/measured_js");
    auto setpoint_service = stream<i2ris::JointState>(node, "i2ris/setpoint_js");
    auto command_service = stream<i2ris::ServoJp>(node, "i2ris/servo_jp");
    auto measured = measured_service.subscriber_builder().create().value();
    auto setpoint = setpoint_service.subscriber_builder().create().value();
    auto commands = command_service.publisher_builder().create().value();

    const auto joints = newest(measured);
    const auto hold = newest(setpoint);
    if (!joints || !hold || (hold->flags & 1U) == 0) {
        std::cerr << "no valid angles: is a model loaded?\n";
        return 1;
    }
    std::cout << "measured " << joints->position[0] << ", " << joints->position[1] << " rad\n";

    std::random_device random;
    const std::uint64_t client_id = (static_cast<std::uint64_t>(random()) << 32U | random()) | 1U;
    for (std::uint64_t sequence = 1; sequence <= 100; ++sequence) {
        i2ris::ServoJp command{};
        command.sequence = sequence;
        command.stamp_ns = now_ns();
        command.client_id = client_id;
        std::copy(std::begin(hold->position), std::end(hold->position), std::begin(command.position));
        command.count = hold->count;
        send(commands.loan_uninit().value().write_payload(std::move(command))).value();
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    std::cout << "100 commands sent\n";
    return 0;
}
