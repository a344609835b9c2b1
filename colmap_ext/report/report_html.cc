// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report_html.h"

#include <cstdio>
#include <stdexcept>

namespace adasfm {
namespace {

template <typename T>
nlohmann::json Pack(const char* type, const std::vector<T>& values) {
  return {{type, EncodeBase64(values.data(), values.size() * sizeof(T))}};
}

}  // namespace

std::string EscapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string JsonForScript(const nlohmann::json& json) {
  const std::string text =
      json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::string escaped;
  escaped.reserve(text.size());
  // These characters occur only inside JSON's strings.
  for (const char c : text) {
    if (c == '<') {
      escaped += "\\u003c";
    } else if (c == '>') {
      escaped += "\\u003e";
    } else if (c == '&') {
      escaped += "\\u0026";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string EncodeBase64(const void* data, size_t num_bytes) {
  static const char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const unsigned char* bytes = static_cast<const unsigned char*>(data);
  std::string text;
  text.reserve((num_bytes + 2) / 3 * 4);
  for (size_t i = 0; i < num_bytes; i += 3) {
    const size_t left = num_bytes - i;
    const unsigned group = bytes[i] << 16 | (left > 1 ? bytes[i + 1] << 8 : 0) |
                           (left > 2 ? bytes[i + 2] : 0);
    text += kDigits[group >> 18];
    text += kDigits[group >> 12 & 63];
    text += left > 1 ? kDigits[group >> 6 & 63] : '=';
    text += left > 2 ? kDigits[group & 63] : '=';
  }
  return text;
}

nlohmann::json PackFloats(const std::vector<float>& values) {
  return Pack("f32", values);
}
nlohmann::json PackUint16(const std::vector<uint16_t>& values) {
  return Pack("u16", values);
}
nlohmann::json PackUint32(const std::vector<uint32_t>& values) {
  return Pack("u32", values);
}
nlohmann::json PackBytes(const std::vector<unsigned char>& values) {
  return Pack("u8", values);
}

std::string FormatFigures(const std::vector<ReportFigure>& figures) {
  std::string html;
  for (const ReportFigure& figure : figures) {
    html += "<div class=\"figure\"><dt>" + EscapeHtml(figure.label) +
            "</dt><dd><b>" + EscapeHtml(figure.value) + "</b><span>" +
            EscapeHtml(figure.note) + "</span></dd></div>\n";
  }
  return html;
}

std::string FormatTable(const ReportTable& table) {
  if (table.rows.empty()) return "";
  std::string html = "<div class=\"scroll\"><table>";
  if (!table.head.empty()) {
    html += "<thead><tr>";
    for (const std::string& cell : table.head) {
      html += "<th scope=\"col\">" + EscapeHtml(cell) + "</th>";
    }
    html += "</tr></thead>";
  }
  html += "<tbody>\n";
  for (const std::vector<std::string>& row : table.rows) {
    const bool is_warning = !row.empty() && row[0] == "warning";
    html += is_warning ? "<tr class=\"warning\">" : "<tr>";
    for (size_t i = 0; i < row.size(); ++i) {
      html += (i == 0 ? "<th scope=\"row\">" : "<td>") + EscapeHtml(row[i]) +
              (i == 0 ? "</th>" : "</td>");
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string FillTemplate(const std::string& text,
                         const std::map<std::string, std::string>& values) {
  std::string filled;
  size_t position = 0;
  while (true) {
    const size_t begin = text.find("{{", position);
    if (begin == std::string::npos) break;
    const size_t end = text.find("}}", begin);
    const auto value =
        end == std::string::npos
            ? values.end()
            : values.find(text.substr(begin + 2, end - begin - 2));
    if (value == values.end()) {
      throw std::invalid_argument("report template: no value for " +
                                  text.substr(begin, 30));
    }
    filled += text.substr(position, begin - position) + value->second;
    position = end + 2;
  }
  return filled + text.substr(position);
}

std::string FormatNumber(const char* format, double value) {
  char buffer[128];
  std::snprintf(buffer, sizeof(buffer), format, value);
  return buffer;
}

std::string FormatCount(int64_t count) {
  std::string text = std::to_string(count);
  for (int i = static_cast<int>(text.size()) - 3; i > 0; i -= 3) {
    text.insert(i, ",");
  }
  return text;
}

}  // namespace adasfm
