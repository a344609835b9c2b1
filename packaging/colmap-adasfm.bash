# SPDX-License-Identifier: BSD-3-Clause
# Completion for colmap-adasfm, and for a colmap that runs our commands: reads
# commands and options from the program's own help, so that it cannot go stale.

_colmap_adasfm() {
  local program=${COMP_WORDS[0]} current=${COMP_WORDS[COMP_CWORD]}
  COMPREPLY=()
  if [ "$COMP_CWORD" = 1 ]; then
    local commands
    commands=$("$program" help 2> /dev/null |
      sed -nE 's/^  +([a-z_]+).*/\1/p' | sort -u)
    mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$current")
  elif [ "${current:0:1}" = - ]; then
    local options
    options=$("$program" "${COMP_WORDS[1]}" -h 2> /dev/null |
      sed -nE 's/^  (-. \[ )?(--[A-Za-z0-9_.]+).*/\2/p')
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
  else
    # Nearly all values that are long to type are paths.
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
    compopt -o filenames 2> /dev/null
  fi
}

complete -F _colmap_adasfm colmap-adasfm colmap
