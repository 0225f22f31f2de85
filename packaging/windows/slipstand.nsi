; Installer of Slipstand. `python -m tools.packages windows` calls makensis with VERSION, FOLDER, TARGET, ICON,
; LICENSE and KILOBYTES. Silently: setup.exe /S [/D=C:\folder], and uninstall.exe /S.
Unicode true
Target amd64-unicode
!include "MUI2.nsh"
!include "x64.nsh"
!include "LogicLib.nsh"

Name "Slipstand ${VERSION}"
OutFile "${TARGET}"
InstallDir "$PROGRAMFILES64\Slipstand"
RequestExecutionLevel admin
SetCompressor /SOLID lzma
BrandingText "Slipstand ${VERSION}"
VIProductVersion "${VERSION}.0"
VIAddVersionKey ProductName "Slipstand"
VIAddVersionKey FileDescription "Installer of Slipstand"
VIAddVersionKey FileVersion "${VERSION}"
VIAddVersionKey LegalCopyright "The Slipstand developers, MIT License"

!define MUI_ICON "${ICON}"
!define MUI_UNICON "${ICON}"
!define MUI_FINISHPAGE_RUN "$INSTDIR\slipstand-window.exe"
!insertmacro MUI_PAGE_LICENSE "${LICENSE}"
!insertmacro MUI_PAGE_DIRECTORY
!insertmacro MUI_PAGE_INSTFILES
!insertmacro MUI_PAGE_FINISH
!insertmacro MUI_UNPAGE_CONFIRM
!insertmacro MUI_UNPAGE_INSTFILES
!insertmacro MUI_LANGUAGE "English"
!insertmacro MUI_LANGUAGE "Russian"

!define UNINSTALL "Software\Microsoft\Windows\CurrentVersion\Uninstall\Slipstand"
!define COMMAND "Software\Microsoft\Windows\CurrentVersion\App Paths\slipstand.exe"
!define RUN_FILE "Software\Classes\Slipstand.Run"

; Before anything is removed. Windows lets a program that runs be renamed, but not opened for writing.
!macro StopIfRunning MESSAGE
  ClearErrors
  ${For} $1 1 2
    StrCpy $2 "$INSTDIR\slipstand.exe"
    ${If} $1 = 2
      StrCpy $2 "$INSTDIR\slipstand-window.exe"
    ${EndIf}
    ${If} ${FileExists} $2
      FileOpen $3 $2 a
      ${If} ${Errors}
        MessageBox MB_ICONSTOP "${MESSAGE}" /SD IDOK
        SetErrorLevel 2
        Abort
      ${EndIf}
      FileClose $3
    ${EndIf}
  ${Next}
!macroend

Function .onInit
  ${IfNot} ${RunningX64}
    MessageBox MB_ICONSTOP "Slipstand needs Windows with 64 bits." /SD IDOK
    Abort
  ${EndIf}
  SetRegView 64
  SetShellVarContext all
  ; An update goes where the program is, and replaces it. Settings and recordings are not in its folder.
  ReadRegStr $0 HKLM "${UNINSTALL}" "InstallLocation"
  StrCmp $0 "" +2
    StrCpy $INSTDIR $0
FunctionEnd

Function un.onInit
  SetRegView 64
  SetShellVarContext all
FunctionEnd

Section
  !insertmacro StopIfRunning "Slipstand is running. Close it and install again."
  RMDir /r "$INSTDIR\_internal"
  SetOutPath "$INSTDIR"
  File /r "${FOLDER}\*.*"
  WriteUninstaller "$INSTDIR\uninstall.exe"
  CreateShortcut "$SMPROGRAMS\Slipstand.lnk" "$INSTDIR\slipstand-window.exe"

  WriteRegStr HKLM "${COMMAND}" "" "$INSTDIR\slipstand.exe"
  ; Run files are HDF5: Slipstand is offered to open them, and does not take them from another program.
  WriteRegStr HKLM "${RUN_FILE}" "" "Slipstand run"
  WriteRegStr HKLM "${RUN_FILE}\DefaultIcon" "" "$INSTDIR\slipstand-window.exe,0"
  WriteRegStr HKLM "${RUN_FILE}\shell\open\command" "" '"$INSTDIR\slipstand-window.exe" "%1"'
  WriteRegStr HKLM "Software\Classes\.h5\OpenWithProgids" "Slipstand.Run" ""

  WriteRegStr HKLM "${UNINSTALL}" "DisplayName" "Slipstand"
  WriteRegStr HKLM "${UNINSTALL}" "DisplayVersion" "${VERSION}"
  WriteRegStr HKLM "${UNINSTALL}" "Publisher" "The Slipstand developers"
  WriteRegStr HKLM "${UNINSTALL}" "DisplayIcon" "$INSTDIR\slipstand-window.exe"
  WriteRegStr HKLM "${UNINSTALL}" "InstallLocation" "$INSTDIR"
  WriteRegStr HKLM "${UNINSTALL}" "UninstallString" '"$INSTDIR\uninstall.exe"'
  WriteRegStr HKLM "${UNINSTALL}" "QuietUninstallString" '"$INSTDIR\uninstall.exe" /S'
  WriteRegDWORD HKLM "${UNINSTALL}" "EstimatedSize" ${KILOBYTES}
  WriteRegDWORD HKLM "${UNINSTALL}" "NoModify" 1
  WriteRegDWORD HKLM "${UNINSTALL}" "NoRepair" 1
SectionEnd

Section "Uninstall"
  !insertmacro StopIfRunning "Slipstand is running. Close it and uninstall again."
  RMDir /r "$INSTDIR\_internal"
  Delete "$INSTDIR\slipstand.exe"
  Delete "$INSTDIR\slipstand-window.exe"
  Delete "$INSTDIR\uninstall.exe"
  RMDir "$INSTDIR"
  Delete "$SMPROGRAMS\Slipstand.lnk"
  DeleteRegKey HKLM "${UNINSTALL}"
  DeleteRegKey HKLM "${COMMAND}"
  DeleteRegKey HKLM "${RUN_FILE}"
  DeleteRegValue HKLM "Software\Classes\.h5\OpenWithProgids" "Slipstand.Run"
  DeleteRegKey /ifempty HKLM "Software\Classes\.h5\OpenWithProgids"
  DeleteRegKey /ifempty HKLM "Software\Classes\.h5"
  ; What the program keeps to start faster, and its log, for who uninstalls. Settings and recordings stay.
  SetShellVarContext current
  RMDir /r "$LOCALAPPDATA\slipstand\Cache"
  RMDir /r "$LOCALAPPDATA\slipstand\Logs"
  RMDir "$LOCALAPPDATA\slipstand"
SectionEnd
