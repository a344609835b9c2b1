// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/command.h"

#include <glog/logging.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "colmap_ext/commands/progress_display.h"
#include "core/interruption.h"
#include "core/parallel.h"
#include "sensors/io/log_file.h"

namespace adasfm {
namespace {

namespace po = boost::program_options;

constexpr char kOutOfMemory[] =
    "out of memory; use fewer threads, or fewer images at a time";
constexpr char kTooFewThreads[] =
    "the system gives too few threads; use a smaller --num_threads";

// Messages of other libraries may have several lines; ours have one.
std::string OneLine(std::string message) {
  while (!message.empty() && std::isspace(message.back())) message.pop_back();
  std::replace(message.begin(), message.end(), '\n', ' ');
  return message;
}

void PrintError(const std::string& message) {
  std::cout.flush();
  std::cerr << "ERROR: " << OneLine(message) << std::endl;
}

// Writes to standard error even while std::cerr is redirected.
void WriteToStderr(const char* text) {
  const ssize_t ignored = write(STDERR_FILENO, text, std::strlen(text));
  static_cast<void>(ignored);
}

// Without this function, a failed CHECK of the host would abort with a core
// dump; glog has already printed the check on standard error.
[[noreturn]] void ExitOnFailedCheck() {
  std::fflush(nullptr);
  WriteToStderr(
      "ERROR: COLMAP stopped at the check above; look at the input that it "
      "names\n");
  _exit(EXIT_FAILURE);
}

bool has_command_ended = false;
std::atomic<bool> may_exit_go_on{false};

// COLMAP's database class and OpenMP exit the process on failures. OpenMP may
// do so in several threads at once, which must not run static destructors
// concurrently.
void ReportExitOfLibrary() {
  if (has_command_ended) {
    may_exit_go_on = true;
    return;
  }
  std::fflush(nullptr);
  WriteToStderr(
      "ERROR: a library stopped at the error above; mend its cause (space, "
      "memory or threads that are short), then give the same command again\n");
  _exit(EXIT_FAILURE);
}

// A second thread skips the handler that the first one is running.
void WaitForReportOfExit() {
  while (!may_exit_go_on) std::this_thread::yield();
}

// Handles exceptions that could not be caught: in a thread of a library, or
// when memory ran out in a noexcept function. Allocates no memory itself.
[[noreturn]] void ReportUncaughtException() {
  WriteToStderr("ERROR: ");
  try {
    const std::exception_ptr exception = std::current_exception();
    if (exception) std::rethrow_exception(exception);
    WriteToStderr(kTooFewThreads);
  } catch (const std::bad_alloc&) {
    WriteToStderr(kOutOfMemory);
  } catch (const std::system_error& error) {
    WriteToStderr(error.code() == std::errc::resource_unavailable_try_again
                      ? kTooFewThreads
                      : error.what());
  } catch (const std::exception& error) {
    WriteToStderr(error.what());
  } catch (...) {
    WriteToStderr("unknown exception");
  }
  WriteToStderr("\n");
  _exit(EXIT_FAILURE);
}

// Eigen frees a matrix twice when resizing it ran out of memory, and glibc then
// aborts, after a message on standard error.
void ReportAbort(int) {
  WriteToStderr(
      "ERROR: a library aborted; mend its cause (most likely memory that is "
      "short), then give the same command again\n");
  _exit(EXIT_FAILURE);
}

void SetUpLogging(const char* name) {
  std::set_terminate(&ReportUncaughtException);
  std::signal(SIGABRT, &ReportAbort);
  google::InitGoogleLogging(name);
  google::InstallFailureFunction(
      reinterpret_cast<google::logging_fail_func_t>(&ExitOnFailedCheck));
  // Nobody asked for log files in /tmp.
  FLAGS_logtostderr = true;
  // A write beyond a size limit then fails like a write to a full disk, and is
  // reported.
  std::signal(SIGXFSZ, SIG_IGN);
}

// OpenBLAS waits forever for buffers that a limit denies. With less than this
// beyond the program's own size, adasfm_global waited forever.
constexpr uint64_t kMinAddressSpace = 256 << 20;

Status CheckAddressSpace() {
  rlimit limit;
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return Status::Ok();
  }
  uint64_t num_pages = 0;
  std::ifstream("/proc/self/statm") >> num_pages;
  const uint64_t needed = num_pages * sysconf(_SC_PAGESIZE) + kMinAddressSpace;
  if (limit.rlim_cur >= needed) return Status::Ok();
  return Status::Error("the limit of address space (ulimit -v) is " +
                       std::to_string(limit.rlim_cur >> 10) +
                       " kB, but this program needs at least " +
                       std::to_string(needed >> 10) + "; raise the limit");
}

constexpr char kUnsafeBlas[] =
    "WARNING: this OpenBLAS has no locks, and errs now and then when several "
    "threads multiply at once; install another build of it (Debian: "
    "libopenblas0-pthread or libopenblas0-openmp in place of "
    "libopenblas0-serial)";

// Returns the exit code of the command.
int CatchAndRun(const Command& command, int argc, char** argv) {
  try {
    const OneOpenMpThread one_thread;
    if (!IsBlasSafeInThreads()) std::cerr << kUnsafeBlas << std::endl;
    Status status = CheckAddressSpace();
    if (status.ok()) {
      UseOneBlasThread();  // OpenBLAS allocates a buffer for it.
      status = command.run(argc, argv);
    }
    if (status.ok()) return EXIT_SUCCESS;
    PrintError(status.message());
  } catch (const Interruption&) {
    PrintError(
        "interrupted; what is finished is kept, and the same command continues "
        "from there");
    return 128 + InterruptingSignal();
  } catch (const std::bad_alloc&) {
    PrintError(std::string(command.name) + ": " + kOutOfMemory);
  } catch (const std::system_error& error) {
    PrintError(std::string(command.name) +
               ": the system refuses: " + error.what() +
               "; if it is short of threads, use a smaller --num_threads");
  } catch (const std::exception& error) {
    PrintError(std::string(command.name) + ": " + error.what());
  } catch (...) {
    PrintError(std::string(command.name) + ": unknown exception");
  }
  return EXIT_FAILURE;
}

}  // namespace

CommandOptions::CommandOptions(const std::string& name,
                               const std::string& description)
    : name_(name), description_(description), options_("Options", 100, 60) {
  options_.add_options()("help,h", "Show this help.");
  options_.add_options()(
      "project_path", po::value<std::string>(&project_path_),
      ".ini file with options; options of the command line override it");
  AddDefault("log_to_stderr", &log_to_stderr_,
             "print COLMAP's informational log lines too (0 or 1)");
  AddDefault("log_level", &log_level_,
             "verbosity of the log lines of COLMAP and Ceres, 0 to 4");
}

void CommandOptions::AddOldName(const std::string& old_name,
                                const std::string& name) {
  old_names_[old_name] = name;
}

std::string CommandOptions::PresentName(const std::string& name) const {
  const auto it = old_names_.find(name);
  if (it == old_names_.end()) return name;
  std::cerr << "NOTE: --" << name << " is --" << it->second << " now"
            << std::endl;
  return it->second;
}

void CommandOptions::PrintHelp() const {
  std::cout << "colmap " << name_ << "\n\n"
            << description_ << "\n\n"
            << options_ << std::endl;
}

Status CommandOptions::ReadProject(const std::string& path,
                                   po::variables_map* values) const {
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) {
    return Status::Error("cannot read the project file " + path +
                         "; check --project_path");
  }
  SkipByteOrderMark(&file);
  // Several commands share a project file, so options of other commands are
  // ignored; a misspelt option of this command is an error.
  po::parsed_options parsed =
      po::parse_config_file(file, options_, /*allow_unregistered=*/true);
  for (po::option& option : parsed.options) {
    if (!option.unregistered) continue;
    if (old_names_.count(option.string_key) > 0) {
      option.string_key = PresentName(option.string_key);
      option.unregistered = false;
      continue;
    }
    const std::string group = option.string_key.substr(
        0, std::min(option.string_key.find('.'), option.string_key.size()));
    if (group.rfind("AdaSfm", 0) != 0) continue;
    const std::vector<boost::shared_ptr<po::option_description>>& known =
        options_.options();
    if (std::any_of(known.begin(), known.end(), [&group](const auto& entry) {
          return entry->long_name().rfind(group + ".", 0) == 0;
        })) {
      return Status::Error(path + ": unknown option '" + option.string_key +
                           "'; see `colmap " + name_ + " -h`");
    }
  }
  po::store(parsed, *values);
  return Status::Ok();
}

Status CommandOptions::Parse(int argc, const char* const* argv) {
  po::variables_map values;
  try {
    const int style = po::command_line_style::default_style &
                      ~po::command_line_style::allow_guessing;
    std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
    for (std::string& word : words) {
      if (word.rfind("--", 0) != 0) continue;
      const size_t end = std::min(word.find('='), word.size());
      word = "--" + PresentName(word.substr(2, end - 2)) + word.substr(end);
    }
    const po::parsed_options parsed =
        po::command_line_parser(words).options(options_).style(style).run();
    for (const po::option& option : parsed.options) {
      if (!option.string_key.empty()) continue;
      return Status::Error(
          "'" + option.original_tokens.at(0) +
          "' is no option; names begin with --, and a value with blanks needs "
          "quotes; see `colmap " +
          name_ + " -h`");
    }
    po::store(parsed, values);
    if (values.count("help")) {
      PrintHelp();
      help_shown_ = true;
      return Status::Ok();
    }
    if (values.count("project_path")) {
      const Status read =
          ReadProject(values["project_path"].as<std::string>(), &values);
      if (!read.ok()) return read;
    }
    po::notify(values);
  } catch (const po::error& error) {
    return Status::Error(std::string(error.what()) + "; see `colmap " + name_ +
                         " -h`");
  }
  FLAGS_minloglevel = log_to_stderr_ ? google::INFO : google::WARNING;
  FLAGS_v = log_level_;
  return Status::Ok();
}

Status CommandOptions::Check(const std::function<Status()>& check) {
  const Status status = check();
  if (status.ok()) return status;
  for (const Default& option : defaults_) {
    option.exchange();
    const Status with_default = check();
    option.exchange();
    if (!with_default.ok() && with_default.message() == status.message()) {
      continue;
    }
    if (status.message().find(option.name) != std::string::npos) break;
    return Status::Error("--" + option.name + ": " + status.message());
  }
  return status;
}

int RunCommand(const Command& command, int argc, char** argv) {
  SetUpLogging(command.name);
  std::atexit(&WaitForReportOfExit);  // Exit handlers run in reverse order.
  std::atexit(&ReportExitOfLibrary);
  const int code = CatchAndRun(command, argc, argv);
  has_command_ended = true;
  return code;
}

}  // namespace adasfm
