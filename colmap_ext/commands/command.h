// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <boost/program_options.hpp>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/status.h"

namespace adasfm {

// The options of one command, in COLMAP's style: `--name value`, grouped
// `--Group.name value`, 0/1 booleans, and `--project_path` for an .ini file
// with the same names. The command line overrides the file. Unlike COLMAP's
// OptionManager, this class never exits the process and does not accept
// abbreviated names.
//
//   Status RunAdasfmExample(int argc, char** argv) {
//     ExampleOptions options;
//     std::string database_path;
//     CommandOptions command("adasfm_example", "Does this and that.");
//     command.AddRequired("database_path", &database_path, "COLMAP database");
//     command.AddDefault("Example.max_error_px", &options.max_error_px,
//                        "largest error of a match [px]");
//     const Status parsed = command.Parse(argc, argv);
//     if (!parsed.ok() || command.HelpShown()) return parsed;
//     ...
//   }
class CommandOptions {
 public:
  CommandOptions(const std::string& name, const std::string& description);

  // `help` describes the value, with its unit.
  template <typename T>
  void AddRequired(const std::string& name, T* value, const std::string& help);
  // The present *value is the default, and is shown as such.
  template <typename T>
  void AddDefault(const std::string& name, T* value, const std::string& help);

  // Adds an earlier name of an existing option, which is accepted with a note
  // on standard error.
  void AddOldName(const std::string& old_name, const std::string& name);

  // Reads argv[1..]; -h prints the help, after which HelpShown() is true and
  // the command has nothing more to do.
  Status Parse(int argc, const char* const* argv);
  bool HelpShown() const { return help_shown_; }

  // Returns the result of a check of the options' values. The error names the
  // option as the user types it; it is found by checking with each option's
  // default in turn.
  Status Check(const std::function<Status()>& check);

 private:
  void PrintHelp() const;
  // The present name of an option; prints a note if `name` is an old one.
  std::string PresentName(const std::string& name) const;
  Status ReadProject(const std::string& path,
                     boost::program_options::variables_map* values) const;

  std::string name_;
  std::string description_;
  boost::program_options::options_description options_;
  std::string project_path_;
  bool log_to_stderr_ = false;
  int log_level_ = 0;
  bool help_shown_ = false;
  struct Default {
    std::string name;
    // Swaps the value and the default.
    std::function<void()> exchange;
  };
  std::vector<Default> defaults_;
  std::map<std::string, std::string> old_names_;
};

// argv[0] is the command's name. An error's message is one line: what, which
// file, what to do; the caller prints it.
using CommandFunction = Status (*)(int argc, char** argv);

struct Command {
  const char* name;
  const char* description;
  CommandFunction run;
};

// Runs the command with logging set up, prints `ERROR: message` on standard
// error when it fails, and returns the exit code: 0, 1, or 130 after Ctrl-C.
// Exceptions and failed checks of the host do not end in an abort.
int RunCommand(const Command& command, int argc, char** argv);

// A value as the help shows it.
template <typename T>
std::string OptionText(const T& value) {
  std::ostringstream text;
  text << value;
  return text.str();
}
inline std::string OptionText(const std::string& value) {
  return value.empty() ? "none" : value;
}

// The help; for a switch it states the allowed values.
template <typename T>
std::string OptionHelp(const std::string& help) {
  const bool is_switch = std::is_same_v<T, bool>;
  return is_switch && help.find("0 or 1") == std::string::npos
             ? help + " (0 or 1)"
             : help;
}

template <typename T>
void CommandOptions::AddRequired(const std::string& name, T* value,
                                 const std::string& help) {
  options_.add_options()(name.c_str(),
                         boost::program_options::value<T>(value)->required(),
                         (help + " (required)").c_str());
}

template <typename T>
void CommandOptions::AddDefault(const std::string& name, T* value,
                                const std::string& help) {
  options_.add_options()(name.c_str(),
                         boost::program_options::value<T>(value)->default_value(
                             *value, OptionText(*value)),
                         OptionHelp<T>(help).c_str());
  defaults_.push_back(
      {name, [value, other = *value]() mutable { std::swap(*value, other); }});
}

}  // namespace adasfm
